"""Contacts never let through, add energy, or shake."""

import math

import numpy as np
import pytest

from ncrs_envs import Scenario
from ncrs_envs.body import parse_body

STRAIGHT_WALLS = ([(-66.0, -66.0), (-8.0, 0.0)], [(66.0, -66.0), (8.0, 0.0)])
LONE_CELL = ["...", ".L.", "..."]
BAR = ["###", "...", "..."]
CROSS = [".#.", "#L#", ".#."]
BIG = ["L" + 14 * "#", *(13 * [15 * "#"]), 15 * "#"]


def _place(state):
    """Pose and velocities."""
    return np.array([state.x, state.y, state.angle, state.vx, state.vy, state.omega])


def _launch(episode, v_x, v_y, omega=0.0):
    episode.state.vx = v_x
    episode.state.vy = v_y
    episode.state.omega = omega


def _coast(episode, steps):
    zero = np.zeros(episode.body.shape, dtype=np.float32)
    for _ in range(steps):
        episode.step(zero)
        yield episode


def _depth_in_light(body, pose, light):
    """Overlap of the light's disc with the nearest cell; 1 where its centre is in the cell."""
    n = body.shape[0]
    x, y, angle = pose
    cos, sin = math.cos(angle), math.sin(angle)
    own_x = cos * (light[0] - x) + sin * (light[1] - y)
    own_y = cos * (light[1] - y) - sin * (light[0] - x)
    rows, columns = np.nonzero(body)
    away_x = np.maximum(np.abs(own_x - (2 * columns - (n - 1))) - 1.0, 0.0)
    away_y = np.maximum(np.abs(own_y - ((n - 1) - 2 * rows)) - 1.0, 0.0)
    return 1.0 - np.hypot(away_x, away_y).min()


@pytest.mark.parametrize(
    "body", [LONE_CELL, BAR, CROSS, BIG], ids=["cell", "bar", "cross", "15x15"]
)
@pytest.mark.parametrize("speed", [50.0, 99.0])
def test_the_light_is_not_tunnelled_through(batched_episode, rng, body, speed):
    """At 50 units/s and at nearly the fastest a robot can go, from all sides, spinning.

    Between two steps the light's centre must not have been inside a cell either.
    """
    light, touching = np.array([40.0, 10.0]), 0
    for _ in range(30):
        bearing = rng.uniform(0, 2 * math.pi)
        ahead = np.array([math.cos(bearing), math.sin(bearing)])
        start = tuple(light - rng.uniform(26.0, 36.0) * ahead)
        episode = batched_episode("light_chase", body, Scenario(start=start, light=tuple(light)))
        _launch(episode, *(speed * ahead), rng.uniform(-6, 6))
        pose, touched = np.array([*episode.center, 0.0]), False
        for _ in _coast(episode, 40):
            earlier, pose = pose, np.array([*episode.center, episode.state.angle])
            for share in np.linspace(0.1, 1.0, 10):
                between = earlier + share * (pose - earlier)
                assert _depth_in_light(episode.body, between, light) < 0.9
            assert _depth_in_light(episode.body, pose, light) < 0.05
            touched = touched or episode.touching
        touching += touched
    assert touching >= 10


@pytest.mark.parametrize("body", [LONE_CELL, BAR, CROSS], ids=["cell", "bar", "cross"])
def test_walls_are_not_tunnelled_through(batched_episode, rng, body):
    """A closed funnel of thin quads: a robot shot at it from below stays below."""
    vertices = np.linspace(-66.0, 0.0, 12)
    # The wall folds to and fro by half a unit; its pieces are as thin as they get.
    left = [(-66.0, -66.0)] + [(-66.0 + 5.6 * i, y) for i, y in enumerate(vertices[1:], 1)]
    right = [(-x, y) for x, y in left]
    left[-1], right[-1] = (0.3, 0.0), (-0.3, 0.0)
    for _ in range(40):
        start = (rng.uniform(-8.0, 8.0), -30.0)
        scenario = Scenario(start=start, light=(0.0, 50.0), walls=(left, right))
        episode = batched_episode("obstacle", body, scenario)
        _launch(episode, rng.uniform(-40, 40), rng.uniform(30, 90), rng.uniform(-5, 5))
        touched = False
        for _ in _coast(episode, 100):
            touched = touched or episode.touching
            assert episode.state.y < 0.0
        assert touched


def test_no_contact_adds_energy(batched_episode, drifting_bodies, kinetic_energy, rng):
    touching = 0
    for _ in range(60):
        body = next(drifting_bodies)
        scenario = Scenario(start=(0.0, -40.0), light=(3.0, -26.0), walls=STRAIGHT_WALLS)
        episode = batched_episode("obstacle", body, scenario)
        _launch(episode, rng.uniform(-50, 50), rng.uniform(-50, 50), rng.uniform(-8, 8))
        energy, touched = kinetic_energy(episode), False
        for _ in _coast(episode, 100):
            touched = touched or episode.touching
            assert kinetic_energy(episode) <= energy * (1 + 1e-9) + 1e-9
            energy = kinetic_energy(episode)
        touching += touched
    assert touching >= 30


def test_a_hit_ball_leaves_with_the_robot_and_no_faster(batched_episode):
    scenario = Scenario(start=(0.0, -20.0), ball=(0.0, -10.0), target=(0.0, 40.0))
    episode = batched_episode("carry_ball", ["###", "LTL", "###"], scenario)
    _launch(episode, 0.0, 40.0)
    for _ in _coast(episode, 15):
        assert episode.state.ball_vy <= 40.0
    mass = 1.0 / episode.robot.inverse_mass
    ball_mass = 0.1 * math.pi
    # Inelastic: momentum is shared, less what the drag has taken since.
    assert episode.state.vy == pytest.approx(40.0 * mass / (mass + ball_mass), rel=0.02)
    assert episode.state.ball_x == pytest.approx(0.0, abs=1e-9)
    assert episode.state.ball_y > episode.state.y + 3.9


@pytest.mark.parametrize(
    "body", [["L#L", "W#W", "W#W"], BIG[:-1] + ["W" * 15]], ids=["3x3", "15x15"]
)
def test_pushing_against_the_light_comes_to_rest(batched_episode, body):
    grid = parse_body(body)
    n = grid.shape[0]
    scenario = Scenario(start=(0.0, -20.0), light=(0.0, 0.0))
    episode = batched_episode("light_chase", grid, scenario)
    gas = np.ones((n, n), dtype=np.float32)
    for _ in range(100):
        episode.step(gas)
    places = []
    for _ in range(100):
        episode.step(gas)
        assert episode.touching
        places.append(_place(episode.state))
    spread = np.ptp(places, axis=0)
    assert np.all(spread[:3] < 0.01)
    assert np.all(np.abs(places)[:, 3:] < 0.1)


def test_a_robot_wedged_between_walls_comes_to_rest(batched_episode):
    episode = batched_episode(
        "obstacle",
        ["L###L", "W###W", "W###W", "W###W", "W###W"],
        Scenario(
            start=(0.0, -30.0),
            light=(0.0, 40.0),
            walls=([(-66.0, -66.0), (-3.0, 0.0)], [(66.0, -66.0), (3.0, 0.0)]),
        ),
    )
    gas = np.ones((5, 5), dtype=np.float32)
    for _ in range(150):
        episode.step(gas)
    place = _place(episode.state)
    for _ in range(50):
        episode.step(gas)
    assert episode.touching
    after = _place(episode.state)
    assert np.allclose(after[:3], place[:3], rtol=0, atol=0.01)
    assert np.all(np.abs(after[3:]) < 0.1)


def test_friction_slows_a_sliding_robot(batched_episode):
    """Along a level wall the tangential impulse is 0.2 times the normal one."""
    walls = (
        [(-66.0, -66.0), (-66.0, -20.0), (66.0, -20.0), (66.0, 0.0)],
        [(66.0, -66.0), (66.0, 6.0)],
    )
    # The left wall ends in a ledge from x = -66 to 66 at y between -20 and 0.
    episode = batched_episode(
        "obstacle",
        ["###", "#L#", "###"],
        Scenario(start=(0.0, -24.0), light=(0.0, 40.0), walls=walls),
    )
    _launch(episode, 30.0, 10.0)
    for _ in _coast(episode, 30):
        pass
    assert episode.state.y < -22.9
    assert episode.state.vy == pytest.approx(0.0, abs=0.5)
    assert 20.0 < episode.state.vx < 29.0
