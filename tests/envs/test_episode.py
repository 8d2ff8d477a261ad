"""Sensing, reward and success of an episode."""

import dataclasses
import math

import numpy as np
import pytest

from ncrs_envs.body import Cell, cell_centers, parse_body
from ncrs_envs.episode import Episode, Robot
from ncrs_envs.scenario import Scenario, sample_scenario
from ncrs_envs.tasks import TASKS, TaskSettings, playfield

CART = parse_body(["LTL", "W#W", "W#W"])
SEEKER = parse_body(["L#L", "W#W", "W#W"])
FULL_GAS = np.ones((3, 3))


def _score(distance, extent, kind):
    return math.exp(-distance / extent) if kind == "exponential" else (distance / extent + 1) ** -2


@pytest.mark.parametrize("kind", ["exponential", "inverse_square"])
@pytest.mark.parametrize("name", TASKS)
def test_observations_and_rewards_come_from_the_new_poses(name, kind, random_body, rng):
    for n in (3, 5):
        task, extent = TASKS[name], playfield(n)
        body = random_body(task, n)
        scenario = sample_scenario(task, rng, None, n)
        episode = Episode(TaskSettings(task, n, kind), Robot(body), scenario)
        for _ in range(10):
            reward = episode.step(rng.uniform(-1, 1, (n, n)))
            x, y, angle = episode.pose
            expected = np.zeros((n, n))
            for row, column in np.argwhere((body == 2) | (body == 3)):
                dx, dy = cell_centers(n)[row, column]
                at = (
                    x + math.cos(angle) * dx - math.sin(angle) * dy,
                    y + math.sin(angle) * dx + math.cos(angle) * dy,
                )
                seen = episode.ball if task.has_ball else scenario.light
                if body[row, column] == Cell.TARGET_SENSOR:
                    seen = scenario.target
                expected[row, column] = _score(math.dist(at, seen), extent, kind)
            assert episode.observation.dtype == np.float32
            assert np.allclose(episode.observation, expected, rtol=0, atol=1e-6)
            if task.has_ball:
                value = 0.5 * _score(math.dist((x, y), episode.ball), extent, kind)
                value += 0.5 * _score(math.dist(episode.ball, scenario.target), extent, kind)
            else:
                value = _score(math.dist((x, y), scenario.light), extent, kind)
            assert reward == pytest.approx(value, abs=1e-12)


def test_success_is_kept_once_reached():
    scenario = Scenario(start=(0.0, 0.0), light=(0.0, 30.0))
    settings = TaskSettings("light_chase", 3)
    episode = Episode(settings, Robot(SEEKER), scenario)
    reached: list[bool] = []
    distances: list[float] = []
    for k in range(100):
        episode.step(FULL_GAS if k < 50 else -FULL_GAS)
        reached.append(episode.distances[0] <= 20.0)
        distances.append(episode.distances[0])
        assert episode.closest == (min(distances),)
        assert episode.success == any(reached)
    assert any(reached)
    assert not reached[0]
    assert not reached[-1]


def test_success_in_carry_ball_is_the_ball_near_the_target():
    settings = TaskSettings("carry_ball", 3)
    far = Scenario(start=(0.0, -20.0), ball=(0.0, 0.0), target=(0.0, 10.5))
    episode = Episode(settings, Robot(CART), far)
    episode.step(np.zeros((3, 3)))
    assert not episode.success
    near = dataclasses.replace(far, target=(0.0, 10.0))
    episode = Episode(settings, Robot(CART), near)
    episode.step(np.zeros((3, 3)))
    assert episode.success


def test_crossed_means_ever_above_the_middle():
    scenario = Scenario(start=(0.0, -1.0), light=(40.0, 40.0))
    episode = Episode(TaskSettings("light_chase", 3), Robot(SEEKER), scenario)
    above = []
    for k in range(60):
        episode.step(FULL_GAS if k < 25 else -FULL_GAS)
        above.append(episode.pose[1] > 0.0)
        assert episode.crossed == any(above)
    assert any(above)
    assert not above[-1]


def test_actions_are_clipped_and_read_in_wheel_cells_only():
    scenario = Scenario(start=(0.0, 0.0), light=(30.0, 30.0))
    settings = TaskSettings("light_chase", 3)
    poses = []
    for action in (FULL_GAS, 7.0 * FULL_GAS, np.where(SEEKER == Cell.WHEEL, 1.0, -0.3)):
        episode = Episode(settings, Robot(SEEKER), scenario)
        for _ in range(20):
            episode.step(action)
        poses.append(episode.pose)
    assert poses[0] == poses[1] == poses[2]
    assert poses[0][1] > 1.0
