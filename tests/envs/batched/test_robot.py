"""Robot records against the reference mass properties and wheel model."""

import numpy as np
import pytest

from ncrs_envs.batched.records import robot_records
from ncrs_envs.body import cell_centers, mass_properties, parse_body
from ncrs_envs.physics import DT, wheel_model
from ncrs_envs.tasks import get_task

# Few heavy cells and many wheels: explicit wheel friction would gain energy.
UNSTABLE = parse_body(["W.W", ".L.", "..."])


def _draw(random_body, grid_size):
    return [random_body(get_task("carry_ball"), grid_size) for _ in range(25)]


@pytest.mark.parametrize("grid_size", [3, 5, 15])
def test_mass_and_center(random_body, grid_size):
    bodies = _draw(random_body, grid_size)
    robots = robot_records(np.array(bodies)).robots
    for body, robot in zip(bodies, robots, strict=True):
        expected = mass_properties(body)
        assert 1.0 / robot.inverse_mass == pytest.approx(expected.mass, rel=1e-12)
        assert 1.0 / robot.inverse_inertia == pytest.approx(expected.inertia, rel=1e-12)
        center = (robot.center_x, robot.center_y)
        assert np.allclose(center, expected.center, rtol=0, atol=1e-12)


def _step_maps(body):
    """The reference's change of twist per unit of twist and of gas in one step."""
    model = wheel_model(body)
    properties = model.mass_properties
    inverse = 1.0 / np.array([properties.mass, properties.mass, properties.inertia])
    scale = DT * inverse[:, None] * model.solver
    return scale @ model.damping, scale @ model.thrust, model


@pytest.mark.parametrize("grid_size", [3, 5, 15])
def test_wheels(random_body, grid_size):
    bodies = _draw(random_body, grid_size)
    if grid_size == 3:
        bodies.append(UNSTABLE)
    robots = robot_records(np.array(bodies))
    implicit = 0
    for body, robot, wheels in zip(bodies, robots.robots, robots.wheels, strict=True):
        damping, thrust, model = _step_maps(body)
        implicit += model.implicit
        wheels = wheels[: robot.wheel_count]
        assert np.array_equal(wheels["place"], model.wheel_cells)
        assert np.allclose(robot.damping, damping, rtol=1e-9, atol=1e-12)
        rows = np.stack([wheels["vx"], wheels["vy"], wheels["omega"]])
        assert np.allclose(rows, thrust, rtol=1e-9, atol=1e-11)
    assert implicit >= (grid_size == 3)


def test_the_implicit_choice_is_the_reference_one(rng):
    """Over sparse bodies, about half of which are unstable."""
    bodies = np.zeros((400, 3, 3), dtype=np.int8)
    for body in bodies:
        places = rng.permutation(9)
        body.reshape(-1)[places[: rng.integers(2, 6)]] = 4
        body.reshape(-1)[places[8]] = 2
    robots = robot_records(bodies).robots
    found, expected = [], []
    for body, robot in zip(bodies, robots, strict=True):
        model = wheel_model(body)
        explicit = DT * robot.inverse_mass * model.damping[0, 0]
        found.append(not np.isclose(robot.damping[0, 0], explicit, rtol=1e-9))
        expected.append(model.implicit)
    assert found == expected
    assert 50 < sum(expected) < 350


def test_sensors_and_exposed_cells():
    body = parse_body(["L####", "#####", "##T##", "#####", "W###W"])
    robots = robot_records(body[None])
    robot = robots.robots[0]
    center = np.array(mass_properties(body).center)
    points = cell_centers(5) - center
    assert robot.sensor_count == 2
    sensors = robots.sensors[0, :2]
    assert sensors["place"].tolist() == [0, 12]
    assert sensors["senses_target"].tolist() == [False, True]
    positions = np.stack([sensors["x"], sensors["y"]], axis=1)
    assert np.allclose(positions, [points[0, 0], points[2, 2]], rtol=0, atol=1e-12)
    # Of a full body the inner 3 x 3 cells touch nothing.
    assert robot.exposed_count == 16
    exposed = np.stack([robots.exposed[0, :16]["x"], robots.exposed[0, :16]["y"]], axis=1)
    outer = np.ones((5, 5), dtype=bool)
    outer[1:-1, 1:-1] = False
    assert np.allclose(exposed, points[outer], rtol=0, atol=1e-12)
    farthest = np.hypot(*(np.abs(points).max(axis=(0, 1)) + 1.0))
    assert farthest <= robot.radius <= farthest + 0.01
