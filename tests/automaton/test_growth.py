"""Growth."""

import numpy as np
import pytest
import torch

from ncrs.automaton.channels import nca_layout
from ncrs.automaton.growth import grow, read_body, record_growth
from ncrs.automaton.nca import NCA, NCAPopulation
from ncrs_envs.body import BodyError

RECORDINGS = {"light_chase": "nca_light", "carry_ball": "nca_carry"}


@pytest.mark.parametrize("task", RECORDINGS)
def test_growth_matches_the_published_implementation(task, golden, golden_genome):
    record = golden(RECORDINGS[task])
    for index in range(16):
        prefix = f"g{index:02d}"
        nca = NCA(task).set_genome(golden_genome(record, prefix))
        body, states = grow(nca, history=True)
        assert states.shape == (10, 5, 5, nca.channels)
        assert np.abs(states - record[f"{prefix}_dev_states"]).max() <= 5e-4
        np.testing.assert_array_equal(body, record[f"{prefix}_body"])
        assert nca.task.is_valid(body) == record[f"{prefix}_valid"]


@pytest.mark.parametrize("task", RECORDINGS)
def test_a_population_grows_what_its_members_grow(task, golden, golden_genome):
    record = golden(RECORDINGS[task])
    vectors = np.stack([golden_genome(record, f"g{index:02d}") for index in range(16)])
    bodies, states = grow(NCAPopulation(vectors, task), history=True)
    assert states.shape == (16, 10, 5, 5, nca_layout(task).channels)
    for index in range(16):
        np.testing.assert_array_equal(bodies[index], record[f"g{index:02d}_body"])
        assert np.abs(states[index] - record[f"g{index:02d}_dev_states"]).max() <= 5e-4


def test_body_is_int8_and_any_grid_size_grows(genomes):
    nca = NCA().set_genome(genomes(1)[0])
    for grid_size in (3, 4, 7, 9):
        body, states = grow(nca, grid_size, history=True)
        assert body.shape == (grid_size, grid_size)
        assert body.dtype == np.int8
        assert len(states) == 5 * (grid_size - grid_size // 2 - 1)


def test_the_first_step_reaches_only_the_seed_and_its_neighbours(full_genome):
    _, states = grow(NCA().set_genome(full_genome), 7, history=True)
    reached = np.abs(states[0]).max(axis=-1) > 0
    assert reached[2:5, 2:5].any()
    reached[2:5, 2:5] = False
    assert not reached.any()


def test_cells_that_lose_life_become_zero():
    nca = NCA()
    vector = np.zeros(4572, dtype=np.float32)
    vector[4572 - 12] = -1.0  # the bias of the body channel: the seed dies in the first step
    _, states = grow(nca.set_genome(vector), history=True)
    assert states[0, 2, 2, 0] == 0.0
    assert states[0, 1, 1, 0] == -1.0
    np.testing.assert_array_equal(states[1], 0.0)


def test_read_out_takes_the_first_of_equal_parts_and_needs_life():
    layout = nca_layout("light_chase")
    state = torch.zeros(12, 3, 3)
    state[0, 0] = 0.2
    state[0, 1] = 0.1  # not above the threshold
    state[3, 0, 1] = 0.5
    state[4, 0, 2] = 0.5
    np.testing.assert_array_equal(read_body(state, layout), [[1, 2, 4], [0, 0, 0], [0, 0, 0]])


def test_stochastic_growth_repeats_with_its_seed(full_genome):
    nca = NCA(fire_rate=0.5).set_genome(full_genome)
    runs = [grow(nca, history=True, seed=seed)[1] for seed in (3, 3, 4)]
    np.testing.assert_array_equal(runs[0], runs[1])
    assert np.abs(runs[0] - runs[2]).max() > 0


@pytest.mark.parametrize("grid_size", [2, 5.0, True, "5"])
def test_bad_grid_size(grid_size):
    with pytest.raises(BodyError, match="grid_size"):
        grow(NCA(), grid_size)


def test_recorded_growth_starts_with_the_seed_and_ends_with_the_body(genomes):
    vectors = genomes(3, 4572)
    growth = record_growth(NCAPopulation(vectors, "light_chase"))
    assert growth.states.shape == (3, 11, 5, 5, 12)
    assert growth.bodies.shape == (3, 11, 5, 5)
    assert (growth.states[:, 0, 2, 2, 0] == 1.0).all()
    assert np.count_nonzero(growth.states[:, 0]) == 3
    for index, vector in enumerate(vectors):
        nca = NCA("light_chase").set_genome(vector)
        alone = record_growth(nca, 5)
        body, states = grow(nca, history=True)
        np.testing.assert_array_equal(alone.states[1:], states)
        np.testing.assert_array_equal(alone.bodies[-1], body)
        np.testing.assert_allclose(alone.states, growth.states[index], atol=1e-5)


def test_noise_without_a_seed_differs_each_time(full_genome):
    nca = NCA(state_noise=0.5)
    nca.set_genome(full_genome)
    first, second = record_growth(nca).states, record_growth(nca).states
    assert not np.array_equal(first, second)
