"""The wheel model and mass properties against independent computations."""

import Box2D
import numpy as np
import pytest

from ncrs_envs.body import CELL_DENSITY, Cell, cell_centers, mass_properties, parse_body
from ncrs_envs.physics import (
    DT,
    WHEEL_FORWARD_FRICTION,
    WHEEL_SIDE_FRICTION,
    WHEEL_THRUST,
    wheel_model,
)
from ncrs_envs.tasks import CARRY_BALL, LIGHT_CHASE

# Two cells of tissue or fewer, wheels far out: what explicit friction cannot carry.
FLIMSY = ["W...W", ".....", "..L..", ".....", "W...W"]


def test_constants_are_the_papers():
    assert (WHEEL_THRUST, WHEEL_FORWARD_FRICTION, WHEEL_SIDE_FRICTION) == (1000.0, 20.0, 100.0)
    assert DT == 0.02
    assert [CELL_DENSITY[c] for c in Cell] == [0.0, 1.0, 1.0, 1.0, 0.1, 1.0]


@pytest.mark.parametrize("n", [3, 5, 9])
def test_mass_properties_agree_with_box2d(n, random_body):
    for _ in range(20):
        body = random_body(CARRY_BALL, n)
        world = Box2D.b2World()  # it owns its bodies, so it must outlive them
        rigid = world.CreateDynamicBody()
        for row, column in np.argwhere(body != Cell.EMPTY):
            x, y = cell_centers(n)[row, column]
            shape = Box2D.b2PolygonShape(box=(1.0, 1.0, (x, y), 0.0))
            rigid.CreateFixture(shape=shape, density=CELL_DENSITY[Cell(int(body[row, column]))])
        ours = mass_properties(body)
        assert ours.mass == pytest.approx(rigid.mass, rel=1e-5)
        assert ours.center == pytest.approx(tuple(rigid.localCenter), abs=1e-4)
        # Box2D gives the inertia about the body's origin.
        about_origin = ours.inertia + ours.mass * np.dot(ours.center, ours.center)
        assert about_origin == pytest.approx(rigid.inertia, rel=1e-4)


def _wrench_by_wheel(body, gas, twist):
    """Force and torque about the centre of mass, one wheel after the other (paper, section 4)."""
    center = np.array(mass_properties(body).center)
    total, k = np.zeros(3), 0
    for row in range(body.shape[0]):
        for column in range(body.shape[1]):
            if body[row, column] != Cell.WHEEL:
                continue
            arm = cell_centers(body.shape[0])[row, column] - center
            velocity = twist[:2] + twist[2] * np.array([-arm[1], arm[0]])
            force = np.array([-100.0 * velocity[0], 1000.0 * gas[k] - 20.0 * velocity[1]])
            total += [*force, arm[0] * force[1] - arm[1] * force[0]]
            k += 1
    return total


def test_the_wheel_model_is_the_sum_over_wheels(random_body, rng):
    explicit = 0
    for _ in range(60):
        body = random_body(LIGHT_CHASE)
        wheels = wheel_model(body)
        gas = rng.uniform(-1, 1, len(wheels.wheel_cells))
        twist = rng.normal(0, [20, 20, 3])
        expected = _wrench_by_wheel(body, gas, twist)
        assert np.allclose(wheels.thrust @ gas - wheels.damping @ twist, expected, rtol=1e-10)
        if not wheels.implicit:
            explicit += 1
            assert np.allclose(wheels.wrench(gas, twist), expected, rtol=1e-10)
    assert explicit > 40


def test_wheels_are_listed_row_by_row():
    assert wheel_model(parse_body(["W.L", ".#.", "WW."])).wheel_cells.tolist() == [0, 6, 7]


def _inertia(wheels):
    properties = wheels.mass_properties
    return np.diag([properties.mass, properties.mass, properties.inertia])


def _coast(wheels, twist, wrench):
    return twist + DT * np.linalg.solve(_inertia(wheels), wrench)


def _energy(wheels, twist):
    return 0.5 * float(twist @ _inertia(wheels) @ twist)


def test_implicit_wheels_solve_the_implicit_equation(rng):
    wheels = wheel_model(parse_body(FLIMSY))
    assert wheels.implicit
    for _ in range(20):
        gas, twist = rng.uniform(-1, 1, 4), rng.normal(0, [20, 20, 3])
        after = _coast(wheels, twist, wheels.wrench(gas, twist))
        expected = twist + DT * np.linalg.solve(
            _inertia(wheels), wheels.thrust @ gas - wheels.damping @ after
        )
        assert np.allclose(after, expected, rtol=1e-9, atol=1e-9)


def test_no_coasting_robot_gains_energy_and_explicit_friction_would(random_body, rng):
    seen = {True: 0, False: 0}
    bodies = [parse_body(FLIMSY), parse_body(["W.W", ".L.", "W.W"])]
    for body in [*bodies, *(random_body(LIGHT_CHASE) for _ in range(300))]:
        wheels = wheel_model(body)
        seen[wheels.implicit] += 1
        idle = np.zeros(len(wheels.wheel_cells))
        rates, modes = np.linalg.eig(np.linalg.solve(_inertia(wheels), wheels.damping))
        stiffest = modes[:, np.argmax(rates.real)].real
        for twist in (stiffest, *rng.normal(0, [20, 20, 3], (5, 3))):
            after = _coast(wheels, twist, wheels.wrench(idle, twist))
            assert _energy(wheels, after) <= _energy(wheels, twist) * (1 + 1e-9)
        explicit = _coast(wheels, stiffest, -wheels.damping @ stiffest)
        gains = _energy(wheels, explicit) > _energy(wheels, stiffest) * (1 + 1e-6)
        assert gains == wheels.implicit
    assert seen[True] >= 2
    assert seen[False] > 200
