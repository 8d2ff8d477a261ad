"""The jointed construction of the published code, and the density of the hull."""

import copy

import gymnasium
import numpy as np
import pytest

from benchmarks.constructions import BODIES
from ncrs_envs import TaskError
from ncrs_envs.body import parse_body
from ncrs_envs.episode import Episode, Robot
from ncrs_envs.scenario import Scenario
from ncrs_envs.tasks import LIGHT_CHASE, TaskSettings

CART = parse_body("L#L/W#W/W#W")
FORK = parse_body(BODIES["fork"])
JOINTED = {"construction": "jointed"}


def _episode(body, scenario, task="light_chase", **settings):
    chosen = TaskSettings(task, len(body), **settings)
    return Episode(chosen, Robot(body, chosen.hull_density), scenario)


def _full_throttle(body, scenario, task="light_chase", **settings):
    """Poses, rewards and the episode itself after 100 steps."""
    episode = _episode(body, scenario, task, **settings)
    gas, poses, rewards = np.ones(body.shape), [], []
    for _ in range(100):
        rewards.append(episode.step(gas))
        poses.append(episode.pose)
    return np.array(poses), np.array(rewards), episode


def _open_field(x=0.0):
    return Scenario(start=(x, -51.0), light=(1000.0, 1000.0))


def test_ordinary_bodies_move_as_one_rigid_body(random_body, rng):
    bodies = [CART, *(random_body(LIGHT_CHASE, 5) for _ in range(4))]
    for body in [body for body in bodies if (body != 0).sum() - (body == 4).sum() >= 3]:
        rigid, jointed = _episode(body, _open_field()), _episode(body, _open_field(), **JOINTED)
        for gas in rng.uniform(-1, 1, (50, *body.shape)):
            rigid.step(gas)
            jointed.step(gas)
            assert jointed.pose == pytest.approx(rigid.pose, abs=0.1)
            np.testing.assert_allclose(jointed.sensor_values, rigid.sensor_values, atol=2e-3)
        assert not jointed.world.touching


def test_light_hulls_give_way_and_run_faster_than_a_wheel():
    for x in (-20.0, 3.0, 31.0):
        for construction, slowest, fastest in (("rigid", 49.5, 50.5), ("jointed", 59.0, 66.0)):
            poses, *_ = _full_throttle(FORK, _open_field(x), construction=construction)
            assert slowest < np.hypot(*(poses[99] - poses[49])[:2]) < fastest  # in a second


def test_the_hulls_density_sets_its_mass():
    # Five cells of the hull and four wheels of density 0.1, each of area 4.
    masses = {density: 4 * (5 * density + 4 * 0.1) for density in (0.5, 1.0)}
    for density, mass in masses.items():
        assert Robot(CART, density).wheels.mass_properties.mass == pytest.approx(mass)
        for construction in ("rigid", "jointed"):
            built = {"construction": construction, "hull_density": density}
            poses, *_ = _full_throttle(CART, _open_field(), **built)
            speed = (poses[3, 1] - poses[2, 1]) * 50
            assert speed == pytest.approx(_speed_after(4, mass), rel=0.02)


def _speed_after(steps, mass):
    """Speed at full throttle of four wheels, from rest."""
    speed = 0.0
    for _ in range(steps):
        speed += 0.02 * (4 * 1000 - 4 * 20 * speed) / mass
    return speed


def test_wheels_hang_on_locked_joints():
    world = _episode(CART, _open_field(), **JOINTED).world
    joints = world._world.joints
    assert len(joints) == (CART == 4).sum()
    for joint in joints:
        assert (joint.lowerLimit, joint.upperLimit, joint.motorSpeed) == (0.0, 0.0, 0.0)
        assert (joint.limitEnabled, joint.motorEnabled) == (True, True)


def test_a_jointed_robot_touches_the_light_but_not_itself():
    near = Scenario(start=(0.0, 0.0), light=(0.0, 12.0))
    episode = _episode(CART, near, **JOINTED)
    episode.step(np.ones((3, 3)))
    assert not episode.world.touching
    for _ in range(60):
        episode.step(np.ones((3, 3)))
    assert episode.world.touching
    assert episode.pose[1] == pytest.approx(12.0 - 1.0 - 3.0, abs=0.1)


def test_copies_of_a_jointed_world_move_on_alike():
    episode = _episode(FORK, _open_field(3.0), hull_density=0.5, **JOINTED)
    for _ in range(20):
        episode.step(np.ones((5, 5)))
    other = copy.deepcopy(episode)
    for one in (episode, other):
        one.step(np.ones((5, 5)))
    assert episode.pose == other.pose


def test_environments_take_both_settings():
    env = gymnasium.make(
        "NCRS-Obstacle-v0", body=FORK, construction="jointed", hull_density=np.float32(0.5)
    )
    assert env.unwrapped.settings == TaskSettings(
        "obstacle", 5, "exponential", None, "jointed", 0.5
    )
    again = gymnasium.make(env.spec)
    for one in (env, again):
        one.reset(seed=1)
    gas = np.ones((5, 5), dtype=np.float32)
    for _ in range(30):
        first, second = env.step(gas), again.step(gas)
    np.testing.assert_array_equal(first[4]["pose"], second[4]["pose"])
    rigid = gymnasium.make("NCRS-Obstacle-v0", body=FORK)
    rigid.reset(seed=1)
    for _ in range(30):
        third = rigid.step(gas)
    assert np.abs(third[4]["pose"] - first[4]["pose"]).max() > 0.5


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"construction": "welded"},
            r"construction must be one of \['rigid', 'jointed'\], got 'we",
        ),
        ({"hull_density": 0.0}, "hull_density must be a number from 0.01 to 100, got 0.0"),
        ({"hull_density": float("nan")}, "hull_density must be .* got nan"),
        ({"hull_density": True}, "hull_density must be .* got True"),
        ({"hull_density": "light"}, "hull_density must be .* got 'light'"),
    ],
)
def test_bad_values_are_refused(given, message):
    with pytest.raises(TaskError, match=message):
        gymnasium.make("NCRS-LightChase-v0", **given)


@pytest.mark.parametrize(
    ("given", "named"),
    [(JOINTED, "construction=jointed"), ({"hull_density": 0.1}, "hull_density=0.1")],
)
def test_the_batched_simulator_refuses_them(given, named):
    with pytest.raises(TaskError, match=rf"has {named}, .* vectorization_mode='sync'"):
        gymnasium.make_vec("NCRS-CarryBall-v0", 2, **given)
    envs = gymnasium.make_vec("NCRS-CarryBall-v0", 2, vectorization_mode="sync", **given)
    assert envs.envs[0].unwrapped.settings == TaskSettings("carry_ball", **given)
