"""The batched simulator against Box2D, on equal scenarios, bodies and actions."""

from dataclasses import replace

import numpy as np
import pytest

from ncrs_envs import Scenario, sample_scenario
from ncrs_envs.body import parse_body
from ncrs_envs.physics import wheel_model
from ncrs_envs.tasks import get_task

FAR_LIGHT = Scenario(start=(0.0, 0.0), light=(1000.0, 0.0))


def _actions(rng, grid_size, held):
    actions = rng.uniform(-1.0, 1.0, (100, grid_size, grid_size)).astype(np.float32)
    return np.repeat(np.sign(actions[::20]), 20, axis=0) if held else actions


@pytest.mark.parametrize("held", [False, True], ids=["noise", "held"])
@pytest.mark.parametrize("grid_size", [3, 5, 15])
def test_free_motion(compare, random_body, rng, grid_size, held):
    for _ in range(8):
        body = random_body(get_task("light_chase"), grid_size)
        result = compare("light_chase", body, FAR_LIGHT, rng, _actions(rng, grid_size, held))
        assert not result.touched
        assert result.apart < 1e-3
        assert result.largest_sensor_gap < 1e-5


@pytest.mark.parametrize(
    "rows", [["W.W", ".L.", "..."], ["WW.", "L..", "..."], ["WW.", "WW.", "..L"]]
)
def test_free_motion_of_unstable_bodies(compare, rng, rows):
    body = parse_body(rows)
    assert wheel_model(body).implicit
    for held in (False, True):
        assert compare("light_chase", body, FAR_LIGHT, rng, _actions(rng, 3, held)).apart < 1e-3


def _touching(task, rng, grid_size):
    """A scenario whose light or ball lies a short way ahead, or with walls as sampled."""
    scenario = sample_scenario(task, rng, grid_size=grid_size)
    if scenario.walls is not None:
        return scenario
    x, y = scenario.start
    point = (x + rng.uniform(-4.0, 4.0), y + rng.uniform(8.0, 25.0))
    return replace(scenario, **{"light" if scenario.ball is None else "ball": point})


@pytest.mark.parametrize("task", ["light_chase", "obstacle", "carry_ball"])
def test_contact(compare, random_body, rng, task):
    results = []
    for _ in range(30):
        body = random_body(get_task(task), 5)
        results.append(compare(task, body, _touching(task, rng, 5), rng))
    difference = np.array([r.batched_fitness - r.box2d_fitness for r in results])
    assert sum(r.touched for r in results) >= 15
    assert np.abs(difference).mean() < 0.005
    assert abs(difference.mean()) < 0.002
    assert np.mean([r.box2d_success == r.batched_success for r in results]) >= 0.95


def test_touching_is_reported_as_by_box2d(batched_episode):
    episode = batched_episode("light_chase", ["L#L", "W#W", "W#W"], Scenario((0, 0), light=(0, 10)))
    seen = []
    for _ in range(40):
        episode.step(np.ones((3, 3)))
        seen.append(episode.touching)
    assert not any(seen[:8])
    assert all(seen[30:])


@pytest.mark.parametrize("score", ["exponential", "inverse_square"])
def test_rewards_and_sensors_follow_the_distances(batched_episode, score):
    scenario = Scenario(start=(0.0, -20.0), ball=(5.0, 10.0), target=(-12.0, 30.0))
    episode = batched_episode("carry_ball", ["LTL", "W#W", "W#W"], scenario, score)

    def value(distance):
        return np.exp(-distance / 50) if score == "exponential" else (distance / 50 + 1) ** -2

    for _ in range(5):
        reward = episode.step(np.zeros((3, 3)))
    to_ball, to_target = np.hypot(5.0, 30.0), np.hypot(17.0, 20.0)
    assert reward == pytest.approx(0.5 * (value(to_ball) + value(to_target)), abs=1e-12)
    expected = np.zeros(9)
    expected[0] = value(np.hypot(7.0, 28.0))
    expected[1] = value(np.hypot(12.0, 48.0))
    expected[2] = value(np.hypot(3.0, 28.0))
    assert np.allclose(episode.observation, expected, rtol=0, atol=1e-7)


def test_an_episode_depends_on_nothing_but_its_inputs(batched_episode, rng):
    """Not on what the solver's room holds, nor on the dtype of actions that float32 can hold."""
    scenario = sample_scenario("obstacle", rng)
    actions = rng.uniform(-0.2, 1.0, (100, 5, 5)).astype(np.float32)
    body = ["L###L", "W###W", "W###W", "#####", "W###W"]
    states = []
    for spoiled in ((0.0, 0), (np.nan, -1), (1e300, 7)):
        episode = batched_episode("obstacle", body, scenario)
        for action in actions:
            episode.spoil(*spoiled)
            episode.step(action)
        states.append(episode.state.tobytes())
    assert len(set(states)) == 1


def test_non_finite_states_show_in_the_reward(batched_episode):
    episode = batched_episode("light_chase", ["L#L", "W#W", "W#W"], Scenario((0, 0), light=(0, 30)))
    episode.state.vx = np.nan
    assert np.isnan(episode.step(np.zeros((3, 3))))
