"""Control."""

import gymnasium
import numpy as np
import pytest

from ncrs.automaton.control import Controller, ObservationError, StateError
from ncrs.automaton.growth import grow
from ncrs.automaton.nca import NCA, NCAPopulation
from ncrs_envs.body import BodyError, sensor_mask, wheel_mask

RECORDINGS = {"light_chase": "nca_light", "carry_ball": "nca_carry"}


@pytest.mark.parametrize("task", RECORDINGS)
@pytest.mark.parametrize("batched", [False, True])
def test_control_matches_the_published_implementation(task, batched, golden, golden_genome):
    record = golden(RECORDINGS[task])
    compared = 0
    for prefix in (f"g{index:02d}" for index in range(16)):
        if not record[f"{prefix}_valid"]:
            continue
        body = record[f"{prefix}_body"]
        vector = golden_genome(record, prefix)
        if batched:
            controller = Controller(NCAPopulation(vector[None], task), body[None])
        else:
            controller = Controller(NCA(task).set_genome(vector), body)
        np.testing.assert_array_equal(
            controller.states.reshape(record[f"{prefix}_control_init"].shape),
            record[f"{prefix}_control_init"],
        )
        observation = np.zeros((5, 5), dtype=np.float32)
        for step in range(10):
            observation[sensor_mask(body)] = record[f"{prefix}_sensor_inputs"][step]
            action = controller.act(observation[None] if batched else observation)
            states = controller.states.reshape(5, 5, -1)
            assert np.abs(states - record[f"{prefix}_control_states"][step]).max() <= 5e-3
            wheels = action.reshape(5, 5)[wheel_mask(body)]
            assert np.abs(wheels - record[f"{prefix}_wheel_outputs"][step]).max() <= 5e-3
        compared += 1
    assert compared >= 5


def test_a_batch_of_robots_equals_each_alone(full_genome):
    nca = NCA().set_genome(full_genome)
    body = grow(nca)
    batch = Controller(nca, np.stack([body, body, body]))
    singles = [Controller(nca, body) for _ in range(3)]
    rng = np.random.default_rng(0)
    for _ in range(5):
        observations = rng.random((3, 5, 5)) * sensor_mask(body)
        together = batch.act(observations)
        assert together.shape == (3, 5, 5)
        for row in range(3):
            alone = singles[row].act(observations[row])
            np.testing.assert_allclose(together[row], alone, rtol=1e-4, atol=1e-5)


def test_a_population_drives_several_runs_of_each_genome(genomes):
    vectors = genomes(3)
    population = NCAPopulation(vectors)
    bodies = np.broadcast_to(
        np.array([[2, 1, 4], [1, 1, 1], [4, 1, 4]], dtype=np.int8), (3, 2, 3, 3)
    )
    observations = np.random.default_rng(0).random((3, 2, 3, 3)) * sensor_mask(bodies)
    together = Controller(population, bodies).act(observations)
    for genome in range(3):
        alone = Controller(NCA().set_genome(vectors[genome]), bodies[genome])
        np.testing.assert_allclose(together[genome], alone.act(observations[genome]), atol=1e-5)


def test_empty_cells_stay_zero_and_fixed_channels_stay(full_genome):
    body = np.array([[2, 0, 4], [0, 1, 0], [4, 0, 4]], dtype=np.int8)
    controller = Controller(NCA().set_genome(full_genome), body)
    start = controller.states
    np.testing.assert_array_equal(start[..., 1], 1.0)  # the control flag, in every cell
    for _ in range(3):
        controller.act(np.full((3, 3), 0.5) * sensor_mask(body))
    after = controller.states
    np.testing.assert_array_equal(after[..., :5], start[..., :5])
    np.testing.assert_array_equal(after[body == 0][:, 5:], 0.0)
    assert np.abs(after[body != 0][:, 5:]).max() > 0


def test_reset_forgets(full_genome):
    nca = NCA(state_noise=0.01).set_genome(full_genome)
    controller = Controller(nca, grow(nca, seed=0), seed=1)
    observation = np.zeros((5, 5))
    first = [controller.act(observation) for _ in range(3)]
    assert np.abs(first[0] - first[1]).max() > 0
    controller.reset()
    np.testing.assert_array_equal(controller.act(observation), first[0])


def test_another_body_keeps_the_states_of_the_cells_that_both_have(full_genome):
    body = np.array([[2, 0, 4], [1, 1, 1], [4, 0, 4]], dtype=np.int8)
    other = np.array([[2, 1, 4], [0, 1, 1], [4, 0, 1]], dtype=np.int8)
    controller = Controller(NCA().set_genome(full_genome), np.stack([body, body]))
    controller.act(np.full((2, 3, 3), 0.5) * sensor_mask(body))
    before = controller.states
    controller.exchange(np.stack([other, body]))
    after = controller.states
    np.testing.assert_array_equal(after[1], before[1])
    kept = (body != 0) & (other != 0)
    np.testing.assert_array_equal(after[0][kept][:, 5:], before[0][kept][:, 5:])
    np.testing.assert_array_equal(after[0][~kept][:, 5:], 0.0)
    np.testing.assert_array_equal(after[0][..., 0], other != 0)
    action = controller.act(np.zeros((2, 3, 3)), rests=np.array([True, False]))
    np.testing.assert_array_equal(controller.states[0], after[0])
    assert not action[0].any()
    assert np.count_nonzero(action[1])


def test_actions_are_zero_but_in_wheels(full_genome):
    nca = NCA().set_genome(full_genome)
    body = grow(nca)
    action = Controller(nca, body).act(np.full((5, 5), 0.4, np.float32) * sensor_mask(body))
    assert action.dtype == np.float32
    assert np.count_nonzero(action[wheel_mask(body)]) == wheel_mask(body).sum()
    assert not action[~wheel_mask(body)].any()


@pytest.mark.parametrize("task", ["LightChase", "Obstacle", "CarryBall"])
def test_five_lines_drive_an_environment(task):
    name = {"LightChase": "light_chase", "Obstacle": "obstacle", "CarryBall": "carry_ball"}[task]
    env = gymnasium.make(f"ncrs_envs:NCRS-{task}-v0")
    observation, info = env.reset(seed=0)
    controller = Controller(NCA(name).set_genome(np.zeros(NCA(name).num_parameters)), info["body"])
    steps, truncated = 0, False
    while not truncated:
        observation, _, _, truncated, _ = env.step(controller.act(observation))
        steps += 1
    assert steps == 100


def test_bad_bodies_and_observations(genomes):
    nca = NCA()
    with pytest.raises(BodyError, match="shape"):
        Controller(nca, [1, 2, 4])
    with pytest.raises(BodyError, match="unknown cell codes"):
        Controller(nca, np.full((3, 3), 9))
    with pytest.raises(BodyError, match="population of 2"):
        Controller(NCAPopulation(genomes(2)), np.ones((3, 3, 3), dtype=int))
    controller = Controller(nca, np.ones((3, 3), dtype=int))
    with pytest.raises(ObservationError, match=r"\(3, 3\), got \(5, 5\)"):
        controller.act(np.zeros((5, 5)))
    with pytest.raises(ObservationError, match="finite, got 1"):
        controller.act(np.where(np.eye(3) * [1, 0, 0] > 0, np.nan, 0.0))


def test_a_state_that_turns_non_finite_is_an_error_that_names_the_robots():
    nca = NCA().set_genome(np.full(4572, 1e30) * np.where(np.arange(4572) % 2, 1, -1))
    controller = Controller(nca, np.ones((2, 3, 3), dtype=int))
    with pytest.raises(StateError, match="robots") as caught:
        controller.act(np.zeros((2, 3, 3)))
    assert set(caught.value.robots) <= {0, 1}
    assert caught.value.robots
