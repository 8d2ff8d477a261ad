"""Robot records against the reference mass properties and wheel model."""

import numpy as np
import pytest

from ncrs_envs.batched import layout
from ncrs_envs.batched.records import robot_arrays
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
    robots, _ = robot_arrays(np.array(bodies))
    for body, robot in zip(bodies, robots, strict=True):
        expected = mass_properties(body)
        assert 1.0 / robot[layout.ROBOT_INVERSE_MASS] == pytest.approx(expected.mass, rel=1e-12)
        assert 1.0 / robot[layout.ROBOT_INVERSE_INERTIA] == pytest.approx(
            expected.inertia, rel=1e-12
        )
        center = robot[layout.ROBOT_CENTER_X : layout.ROBOT_CENTER_Y + 1]
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
    robots, cells = robot_arrays(np.array(bodies))
    implicit = 0
    for body, robot, indices in zip(bodies, robots, cells, strict=True):
        damping, thrust, model = _step_maps(body)
        implicit += model.implicit
        count = indices[layout.CELLS_WHEELS]
        first = layout.CELLS_HEADER
        assert np.array_equal(indices[first : first + count], model.wheel_cells)
        first = layout.ROBOT_DAMPING
        assert np.allclose(robot[first : first + 9].reshape(3, 3), damping, rtol=1e-9, atol=1e-12)
        first = layout.ROBOT_HEADER
        rows = robot[first : first + 3 * count].reshape(count, 3)
        assert np.allclose(rows.T, thrust, rtol=1e-9, atol=1e-11)
    assert implicit >= (grid_size == 3)


def test_the_implicit_choice_is_the_reference_one(rng):
    """Over sparse bodies, about half of which are unstable."""
    bodies = np.zeros((400, 3, 3), dtype=np.int8)
    for body in bodies:
        places = rng.permutation(9)
        body.reshape(-1)[places[: rng.integers(2, 6)]] = 4
        body.reshape(-1)[places[8]] = 2
    robots, _ = robot_arrays(bodies)
    found, expected = [], []
    for body, robot in zip(bodies, robots, strict=True):
        model = wheel_model(body)
        explicit = DT * robot[layout.ROBOT_INVERSE_MASS] * model.damping[0, 0]
        found.append(not np.isclose(robot[layout.ROBOT_DAMPING], explicit, rtol=1e-9))
        expected.append(model.implicit)
    assert found == expected
    assert 50 < sum(expected) < 350


def test_sensors_and_exposed_cells():
    body = parse_body(["L####", "#####", "##T##", "#####", "W###W"])
    robots, cells = robot_arrays(body[None])
    robot, indices = robots[0], cells[0]
    center = np.array(mass_properties(body).center)
    points = cell_centers(5) - center
    assert indices[layout.CELLS_SENSORS] == 2
    assert indices[layout.CELLS_HEADER + 25 : layout.CELLS_HEADER + 27].tolist() == [0, 12]
    assert indices[layout.CELLS_HEADER + 50 : layout.CELLS_HEADER + 52].tolist() == [0, 1]
    first = layout.ROBOT_HEADER + 75
    sensors = robot[first : first + 4].reshape(2, 2)
    assert np.allclose(sensors, [points[0, 0], points[2, 2]], rtol=0, atol=1e-12)
    # Of a full body the inner 3 x 3 cells touch nothing.
    assert indices[layout.CELLS_EXPOSED] == 16
    farthest = np.hypot(*(np.abs(points).max(axis=(0, 1)) + 1.0))
    assert farthest <= robot[layout.ROBOT_RADIUS] <= farthest + 0.01
