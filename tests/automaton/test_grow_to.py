"""Genomes that grow a given body."""

import numpy as np
import pytest
import torch

import ncrs
from ncrs.automaton.channels import nca_layout
from ncrs.automaton.grow_to import GROWTH_UNITS, GrowthError
from ncrs_envs.body import BodyError, parse_body

BODIES = [
    ("light_chase", "...../LWWWL/WWWWW/WWWWW/L...L"),
    ("light_chase", "..X.L/W..../XW.../X.LX./.....".replace("X", "#")),  # in pieces
    ("obstacle", "..W../.LWL./..W../..W../.WWW."),
    ("carry_ball", "T...T/WWWWW/WWWWW/.LWL./....."),
]


@pytest.mark.parametrize(("task", "rows"), BODIES)
def test_a_body_is_grown_by_every_engine_and_stands_still(task, rows):
    body = parse_body(rows)
    genome = ncrs.grow_to(rows, task)
    assert genome.dtype == np.float32
    np.testing.assert_array_equal(ncrs.grow(ncrs.NCA(task).set_genome(genome), len(body)), body)
    for engine in ("batched", "box2d"):
        result = ncrs.evaluate(genome, task, episodes=2, grid_size=len(body), engine=engine)
        np.testing.assert_array_equal(result.bodies[0], body)
    controller = ncrs.Controller(ncrs.NCA(task).set_genome(genome), body)
    for value in (0.0, 0.9):
        assert not controller.act(np.full(body.shape, value)).any()
    assert not controller.states[..., nca_layout(task).changing_channels][body == 4].any()


def test_only_the_last_units_are_used():
    layout = nca_layout("light_chase")
    genome = ncrs.grow_to(BODIES[0][1])
    reading, bias1, middle, bias2, writing, _ = (part[0] for part in layout.layers(genome[None]))
    first, second = GROWTH_UNITS
    assert not reading[:-first].any()
    assert not bias1[:-first].any()
    assert not middle[:-second].any()
    assert not middle[:, :-first].any()
    assert not bias2.any()
    assert not writing[:, :-second].any()


def test_a_mirrored_body_has_a_symmetric_genome():
    layout = nca_layout("carry_ball")
    genome = ncrs.grow_to(BODIES[3][1], "carry_ball")
    np.testing.assert_allclose(layout.symmetric(genome[None])[0], genome, atol=1e-7)


def test_a_search_can_start_from_it(tmp_path):
    path = tmp_path / "genome.npy"
    np.save(path, ncrs.grow_to(BODIES[3][1], "carry_ball"))
    run = ncrs.train(
        tmp_path / "run", task={"name": "carry_ball"}, start_from=str(path), generations=1,
        episodes=2, champion_episodes=2, optimizer={"population": 4, "sigma": 1e-6, "parents": 2},
        progress=False,
    )  # fmt: skip
    np.testing.assert_array_equal(run.champion.body, parse_body(BODIES[3][1]))


def test_one_seed_gives_one_genome_whatever_torch_is_told():
    rows = BODIES[0][1]
    expected = ncrs.grow_to(rows, seed=3)
    before = torch.random.get_rng_state()
    with torch.inference_mode(), torch.autocast("cpu", dtype=torch.bfloat16):
        np.testing.assert_array_equal(ncrs.grow_to(rows, seed=3), expected)
    assert torch.equal(torch.random.get_rng_state(), before)
    assert not np.array_equal(ncrs.grow_to(rows, seed=4), expected)


def test_bad_input_is_refused():
    with pytest.raises(BodyError, match="at least 2 wheels"):
        ncrs.grow_to("L../.../...")
    with pytest.raises(BodyError, match="cannot hold target sensor"):
        ncrs.grow_to("L.T/W.W/...")
    with pytest.raises(GrowthError, match="two numbers from 1 to 30"):
        ncrs.grow_to("L../W.W/...", units=(0, 31))


def test_what_cannot_be_found_is_an_error(monkeypatch):
    monkeypatch.setattr("ncrs.automaton.grow_to._STEPS", 2)
    with pytest.raises(GrowthError, match="4 attempts; use more of the 30 units"):
        ncrs.grow_to(BODIES[1][1])


@pytest.mark.slow
@pytest.mark.parametrize("size", [3, 5, 7, 9])
def test_random_bodies_of_every_size_grow(size):
    generator = np.random.default_rng(size)
    for task in ("light_chase", "carry_ball"):
        codes, count = nca_layout(task).part_codes, 0
        while count < 5:
            drawn = generator.choice(codes, (size, size))
            body = np.where(generator.random((size, size)) < 0.6, drawn, 0).astype(np.int8)
            if nca_layout(task).task.is_valid(body):
                genome = ncrs.grow_to(body, task)
                grown = ncrs.grow(ncrs.NCA(task).set_genome(genome), size)
                np.testing.assert_array_equal(grown, body)
                count += 1
