"""A body's constants as records: mass, wheels, sensors and exposed cells."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.layout import Point, Robot, Robots, Sensor, Wheel
from ncrs_envs.body import CELL_DENSITY, CELL_SIZE, Cell
from ncrs_envs.physics import (
    DT,
    STABILITY_TOLERANCE,
    WHEEL_FORWARD_FRICTION,
    WHEEL_SIDE_FRICTION,
    WHEEL_THRUST,
)

_CELL_MASS = np.array([CELL_DENSITY[cell] * CELL_SIZE**2 for cell in Cell])
_EMPTY = int(Cell.EMPTY)
_LIGHT_SENSOR = int(Cell.LIGHT_SENSOR)
_TARGET_SENSOR = int(Cell.TARGET_SENSOR)
_TOUCH_SENSOR = int(Cell.TOUCH_SENSOR)
_WHEEL = int(Cell.WHEEL)
_HALF_DIAGONAL = 0.5 * CELL_SIZE * 2.0**0.5
# |1 - dt * rate| exceeds 1 by more than the tolerance if and only if the rate exceeds this.
_MAX_STABLE_RATE = (2.0 + STABILITY_TOLERANCE) / DT


@kernel
def _mass_properties(body: NDArray[np.int8]) -> tuple[float, float, float, float]:
    """Return mass, centre of mass (x, y, body frame) and inertia; see ``body.mass_properties``."""
    n = body.shape[0]
    middle = 0.5 * (n - 1)
    mass = 0.0
    moment_x = 0.0
    moment_y = 0.0
    for row in range(n):
        for column in range(n):
            cell_mass = _CELL_MASS[body[row, column]]
            mass += cell_mass
            moment_x += cell_mass * (column - middle) * CELL_SIZE
            moment_y += cell_mass * (middle - row) * CELL_SIZE
    center_x = moment_x / mass
    center_y = moment_y / mass
    inertia = 0.0
    for row in range(n):
        for column in range(n):
            x = (column - middle) * CELL_SIZE - center_x
            y = (middle - row) * CELL_SIZE - center_y
            inertia += _CELL_MASS[body[row, column]] * (CELL_SIZE**2 / 6.0 + x * x + y * y)
    return mass, center_x, center_y, inertia


@kernel
def _is_exposed(body: NDArray[np.int8], row: int, column: int) -> bool:
    """Return True if one of the cell's four sides is free."""
    last = body.shape[0] - 1
    if row == 0 or column == 0 or row == last or column == last:
        return True
    return bool(
        body[row - 1, column] == _EMPTY
        or body[row + 1, column] == _EMPTY
        or body[row, column - 1] == _EMPTY
        or body[row, column + 1] == _EMPTY
    )


@kernel
def _position(place: int, grid_size: int, robot: Robot) -> tuple[float, float]:
    """Return the centre of a cell, body frame, relative to the centre of mass."""
    middle = 0.5 * (grid_size - 1)
    x = (place % grid_size - middle) * CELL_SIZE - robot.center_x
    y = (middle - place // grid_size) * CELL_SIZE - robot.center_y
    return x, y


@kernel
def prepare_robot(
    body: NDArray[np.int8],
    robot: Robot,
    wheels: NDArray[Wheel],
    sensors: NDArray[Sensor],
    exposed: NDArray[Point],
) -> None:
    """Fill the records of a body that is not empty.

    Args:
        body: Valid cell codes, shape ``(n, n)``.
        robot: Output.
        wheels: Output, with room for ``n * n`` items, as in the arrays below.
        sensors: Output.
        exposed: Output, centres of the cells with a free side.
    """
    n = body.shape[0]
    mass, robot.center_x, robot.center_y, inertia = _mass_properties(body)
    robot.inverse_mass = 1.0 / mass
    robot.inverse_inertia = 1.0 / inertia
    wheel_count = 0
    sensor_count = 0
    exposed_count = 0
    radius = 0.0
    for place in range(n * n):
        row = place // n
        column = place % n
        code = body[row, column]
        if code == _EMPTY:
            continue
        x, y = _position(place, n, robot)
        radius = max(radius, math.sqrt(x * x + y * y) + _HALF_DIAGONAL)
        if code == _WHEEL:
            wheel: Wheel = wheels[wheel_count]
            wheel.place = place
            wheel_count += 1
        elif code in (_LIGHT_SENSOR, _TARGET_SENSOR, _TOUCH_SENSOR):
            sensor: Sensor = sensors[sensor_count]
            sensor.place = place
            sensor.senses_target = code == _TARGET_SENSOR
            sensor.senses_touch = code == _TOUCH_SENSOR
            sensor.exposed = exposed_count if _is_exposed(body, row, column) else -1
            sensor.x = x
            sensor.y = y
            sensor_count += 1
        if _is_exposed(body, row, column):
            point: Point = exposed[exposed_count]
            point.x = x
            point.y = y
            exposed_count += 1
    robot.radius = radius
    robot.wheel_count = wheel_count
    robot.sensor_count = sensor_count
    robot.exposed_count = exposed_count
    _prepare_wheels(robot, wheels[:wheel_count], n, mass, inertia)


@kernel
def prepare_robots(bodies: NDArray[np.int8], robots: Robots) -> None:
    """Fill the records of many bodies, shape ``(bodies, n, n)``."""
    for i in range(len(bodies)):
        prepare_robot(
            bodies[i], robots.robots[i], robots.wheels[i], robots.sensors[i], robots.exposed[i]
        )


@kernel
def _prepare_wheels(
    robot: Robot, wheels: NDArray[Wheel], grid_size: int, mass: float, inertia: float
) -> None:
    """Fill the wheels' twist changes per unit of gas, and the damping.

    With ``M = diag(mass, mass, inertia)``, damping ``D`` and thrust ``T`` a step changes the
    body-frame twist by ``dt K^-1 (T g - D u)``: explicitly with ``K = M``, implicitly with
    ``K = M + dt D`` (see ``physics.wheel_model``). The rows of ``D`` here are those of the sums
    over wheels at (x, y) of ``20 (0, 1, x)^T (0, 1, x) + 100 (1, 0, -y)^T (1, 0, -y)``.
    """
    count = len(wheels)
    xx = count * WHEEL_SIDE_FRICTION
    yy = count * WHEEL_FORWARD_FRICTION
    x_turn = 0.0
    y_turn = 0.0
    turn = 0.0
    for i in range(count):
        wheel: Wheel = wheels[i]
        x, y = _position(wheel.place, grid_size, robot)
        x_turn -= WHEEL_SIDE_FRICTION * y
        y_turn += WHEEL_FORWARD_FRICTION * x
        turn += WHEEL_FORWARD_FRICTION * x * x + WHEEL_SIDE_FRICTION * y * y
    # The rates are the eigenvalues of M^-1 D. All are stable if limit * M - D is positive
    # semidefinite, which follows from its diagonal and Schur complement for a matrix of this shape.
    p = _MAX_STABLE_RATE * mass - xx
    q = _MAX_STABLE_RATE * mass - yy
    r = _MAX_STABLE_RATE * inertia - turn
    stable = p >= 0.0 and q >= 0.0 and p * q * r >= x_turn * x_turn * q + y_turn * y_turn * p
    stable = stable and r >= 0.0
    implicit_dt = 0.0 if stable else DT
    k_xx = mass + implicit_dt * xx
    k_yy = mass + implicit_dt * yy
    k_x = implicit_dt * x_turn
    k_y = implicit_dt * y_turn
    # K has no xy entry; the rotation is solved first, from the Schur complement.
    schur = inertia + implicit_dt * turn - k_x * k_x / k_xx - k_y * k_y / k_yy
    for column in range(3):
        d_x = xx if column == 0 else (0.0 if column == 1 else x_turn)
        d_y = yy if column == 1 else (0.0 if column == 0 else y_turn)
        d_turn = x_turn if column == 0 else (y_turn if column == 1 else turn)
        omega = (d_turn - k_x * d_x / k_xx - k_y * d_y / k_yy) / schur
        robot.damping[0, column] = DT * (d_x - k_x * omega) / k_xx
        robot.damping[1, column] = DT * (d_y - k_y * omega) / k_yy
        robot.damping[2, column] = DT * omega
    for i in range(count):
        wheel = wheels[i]
        x, _ = _position(wheel.place, grid_size, robot)
        omega = WHEEL_THRUST * (x - k_y / k_yy) / schur
        wheel.vx = DT * (-k_x * omega) / k_xx
        wheel.vy = DT * (WHEEL_THRUST - k_y * omega) / k_yy
        wheel.omega = DT * omega
