"""The Box2D world against plain rigid-body mechanics, and its contacts."""

import math

import numpy as np
import pytest

from ncrs_envs.body import parse_body
from ncrs_envs.box2d_world import RobotWorld
from ncrs_envs.physics import DT, wheel_model
from ncrs_envs.scenario import Scenario
from ncrs_envs.tasks import LIGHT_CHASE

CART = parse_body(["L#L", "W#W", "W#W"])
FAR_LIGHT = (45.0, 45.0)


def _world(body, **fields):
    return RobotWorld(body, wheel_model(body), Scenario(**{"start": (0.0, 0.0), **fields}))


def _integrate(body, gas):
    """Semi-implicit Euler of the same rigid body in double precision; poses of the grid centre."""
    wheels = wheel_model(body)
    properties = wheels.mass_properties
    center = np.array(properties.center)
    position, angle, velocity, spin = center.copy(), 0.0, np.zeros(2), 0.0
    for row in gas:
        cos, sin = math.cos(angle), math.sin(angle)
        turn = np.array([[cos, -sin], [sin, cos]])
        wrench = wheels.wrench(row, np.array([*(turn.T @ velocity), spin]))
        velocity = velocity + DT * (turn @ wrench[:2]) / properties.mass
        spin += DT * wrench[2] / properties.inertia
        step = DT * velocity
        position = position + step * min(1.0, 2.0 / max(math.hypot(*step), 1e-12))
        angle += DT * spin
        cos, sin = math.cos(angle), math.sin(angle)
        yield (*(position - np.array([[cos, -sin], [sin, cos]]) @ center), angle)


@pytest.mark.parametrize("n", [3, 5])
def test_free_motion_is_that_of_one_rigid_body(n, random_body, rng):
    for _ in range(6):
        body = random_body(LIGHT_CHASE, n)
        world = _world(body, light=(1000.0, 1000.0))
        gas = rng.uniform(-1, 1, (40, len(wheel_model(body).wheel_cells)))
        for k, expected in enumerate(_integrate(body, gas)):
            world.step(gas[k])
            assert world.pose == pytest.approx(expected, abs=5e-3)
        assert not world.touching


def test_equal_gas_drives_straight_ahead_to_the_terminal_speed():
    world = _world(CART, light=(1000.0, 1000.0))
    for _ in range(400):
        world.step(np.ones(4))
    v_x, v_y, spin = world.twist
    assert (v_x, spin) == pytest.approx((0.0, 0.0), abs=1e-3)
    assert v_y == pytest.approx(50.0, rel=1e-3)  # 1000 / 20
    assert world.pose[0] == pytest.approx(0.0, abs=1e-2)


def test_a_robot_without_gas_stays_where_it_is():
    world = _world(CART, start=(3.0, -4.0), light=FAR_LIGHT)
    for _ in range(10):
        world.step(np.zeros(4))
    assert world.pose == (3.0, -4.0, 0.0)


def test_the_light_is_solid():
    world = _world(CART, light=(0.0, 12.0))
    for _ in range(100):
        world.step(np.ones(4))
    assert world.touching
    assert world.pose[1] == pytest.approx(12.0 - 1.0 - 3.0, abs=0.05)


def test_the_ball_is_pushed_and_slows_down():
    world = _world(CART, ball=(0.0, 8.0), target=(0.0, 40.0))
    for _ in range(80):
        world.step(np.ones(4))
    x, y = world.ball
    assert world.touching
    assert abs(x) < 0.5
    assert y == pytest.approx(world.pose[1] + 3.0 + 1.0, abs=0.1)

    # Drag -v on a disc of mass 0.1 pi: the speed falls by dt / m of itself each step.
    world._ball.position, world._ball.linearVelocity = (0.0, -40.0), (0.0, -20.0)
    mass = 0.1 * math.pi
    speed = 20.0
    for _ in range(5):
        world.step(np.zeros(4))
        speed *= 1.0 - DT / mass
        assert -world._ball.linearVelocity[1] == pytest.approx(speed, rel=1e-4)


def test_walls_are_solid_between_their_line_and_the_outside():
    walls = ([(-10.0, -60.0), (-10.0, 10.0)], [(10.0, -60.0), (-5.0, 10.0)])
    world = _world(CART, walls=walls, light=(0.0, 40.0))
    for _ in range(100):
        world.step(np.ones(4))
    assert world.touching
    assert -7.3 < world.pose[0] < 0.0
    assert world.pose[1] < 7.0


def test_there_is_no_ball_where_the_scenario_has_none():
    assert _world(CART, light=FAR_LIGHT).ball is None
