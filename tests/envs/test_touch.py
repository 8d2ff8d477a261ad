"""Touch sensors: what they feel, and that both simulators feel the same."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import ncrs_envs
from ncrs_envs.body import Cell, parse_body
from ncrs_envs.physics import TOUCH_DECAY
from ncrs_envs.scenario import sample_scenarios
from ncrs_envs.tasks import OBSTACLE_TOUCH, Task, TaskError

ID = "NCRS-ObstacleTouch-v0"
BODY = parse_body("C.L.C/WWWWW/WW.WW/..#../C...C")
TOUCH = BODY == Cell.TOUCH_SENSOR


def gas(steps, robots):
    """Mostly forward, unevenly, so that robots graze the walls and turn along them."""
    drawn = 1 + 0.5 * np.random.default_rng(0).normal(size=(steps, robots, 5, 5))
    return np.clip(drawn, -1, 1).astype(np.float32)


def observed(scenarios, actions):
    """The observations of the batched simulator, ``(steps + 1, robots, 5, 5)``."""
    envs = gymnasium.make_vec(ID, num_envs=len(scenarios), body=BODY)
    first, _ = envs.reset(options={"scenario": scenarios})
    return np.stack([first, *(envs.step(action)[0] for action in actions)])


def observed_on_box2d(scenario, actions):
    env = gymnasium.make(ID, body=BODY)
    first, _ = env.reset(options={"scenario": scenario})
    return np.stack([first, *(env.step(action)[0] for action in actions)])


def test_both_simulators_feel_the_same():
    """A cell on the verge of touching may do so in one of them only."""
    scenarios = sample_scenarios(OBSTACLE_TOUCH, 7, 8)
    actions = gas(100, 8)
    batched = observed(scenarios, actions)
    felt = differ = 0
    for index, scenario in enumerate(scenarios):
        box2d = observed_on_box2d(scenario, actions[:, index])
        apart = np.abs(box2d - batched[:, index])
        together = (apart[:, ~TOUCH].max(axis=1) < 1e-5).cumprod().astype(bool)
        touches = [values[together][:, TOUCH] == 1 for values in (batched[:, index], box2d)]
        felt += touches[0].sum()
        differ += (touches[0] != touches[1]).sum()
    assert felt > 200
    assert differ <= 0.02 * felt


def test_a_touch_fades():
    """A robot that backs away from a wall; every value follows from the one before."""
    scenarios = sample_scenarios(OBSTACLE_TOUCH, 7, 4)
    actions = gas(100, 4)
    actions[70:] = -1
    values = observed(scenarios, actions)[:, :, TOUCH]
    assert not values[0].any()
    before, after = values[:-1], values[1:]
    touching = after == 1
    expected = (TOUCH_DECAY * before[~touching].astype(np.float64)).astype(np.float32)
    np.testing.assert_array_equal(after[~touching], expected)
    faded = after[~touching & (before == 1)]
    assert len(faded) > 3
    np.testing.assert_array_equal(faded, np.float32(0.8))
    assert touching[:70].any()


def test_the_light_is_not_felt():
    drawn = sample_scenarios(OBSTACLE_TOUCH, 7, 1)[0]
    x, y = drawn.start
    scenario = replace(drawn, light=(x - 4.0, y + 9.0))
    actions = np.ones((20, 1, 5, 5), dtype=np.float32)
    batched, box2d = observed([scenario], actions)[:, 0], observed_on_box2d(scenario, actions[:, 0])
    assert batched[:, 0, 2].max() > np.exp(-5.0 / 60)  # it has come to the light
    assert not batched[:, TOUCH].any()
    assert not box2d[:, TOUCH].any()


def test_the_task():
    env = gymnasium.make(ID)
    assert ncrs_envs.body_to_characters(env.unwrapped.body).split("\n")[1] == ".LCL."
    assert OBSTACLE_TOUCH.min_sensors == 2
    assert OBSTACLE_TOUCH.cell_label(Cell.TOUCH_SENSOR) == "touch sensor"
    with pytest.raises(ncrs_envs.BodyError, match="1 touch sensor"):
        gymnasium.make(ID, body="..L../WW.WW/...../...../.....")
    with pytest.raises(ncrs_envs.BodyError, match="cannot hold touch sensor"):
        gymnasium.make("NCRS-Obstacle-v0", body="..L../WWCWW/...../...../.....")
    with pytest.raises(TaskError, match="needs a light and walls"):
        Task("feel", "Feel-v0", 20.0, (), has_light=True, has_touch=True)
