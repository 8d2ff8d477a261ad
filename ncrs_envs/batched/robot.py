"""A body's constants as a flat record: mass, wheels, sensors and exposed cells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.layout import (
    CELLS_EXPOSED,
    CELLS_GRID_SIZE,
    CELLS_HEADER,
    CELLS_SENSORS,
    CELLS_WHEELS,
    ROBOT_CENTER_X,
    ROBOT_CENTER_Y,
    ROBOT_DAMPING,
    ROBOT_HEADER,
    ROBOT_INVERSE_INERTIA,
    ROBOT_INVERSE_MASS,
    ROBOT_RADIUS,
)
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
_WHEEL = int(Cell.WHEEL)
_HALF_DIAGONAL = 0.5 * CELL_SIZE * 2.0**0.5
# |1 - dt * rate| exceeds 1 by more than the tolerance exactly where the rate exceeds this.
_LARGEST_STABLE_RATE = (2.0 + STABILITY_TOLERANCE) / DT


@kernel
def _mass_properties(body: NDArray[np.int8]) -> tuple[float, float, float, float]:
    """Mass, centre of mass (x, y, body frame) and inertia; see ``body.mass_properties``."""
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
    """Whether one of the cell's four sides is free."""
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
def prepare_robot(
    body: NDArray[np.int8], robot: NDArray[np.float64], cells: NDArray[np.int32]
) -> None:
    """Fill the records of a body with at least one cell (see ``layout``).

    Args:
        body: cell codes, shape ``(n, n)``, already valid.
        robot: output, float64, shape ``(robot_size(n),)``.
        cells: output, int32, shape ``(cells_size(n),)``.
    """
    n = body.shape[0]
    places = n * n
    middle = 0.5 * (n - 1)
    mass, center_x, center_y, inertia = _mass_properties(body)
    sensor_start = ROBOT_HEADER + 3 * places
    exposed_start = ROBOT_HEADER + 5 * places
    wheels = 0
    sensors = 0
    exposed = 0
    radius = 0.0
    for row in range(n):
        for column in range(n):
            code = body[row, column]
            if code == _EMPTY:
                continue
            x = (column - middle) * CELL_SIZE - center_x
            y = (middle - row) * CELL_SIZE - center_y
            radius = max(radius, (x * x + y * y) ** 0.5 + _HALF_DIAGONAL)
            place = row * n + column
            if code == _WHEEL:
                cells[CELLS_HEADER + wheels] = place
                robot[ROBOT_HEADER + 3 * wheels] = x
                robot[ROBOT_HEADER + 3 * wheels + 1] = y
                wheels += 1
            elif code in (_LIGHT_SENSOR, _TARGET_SENSOR):
                cells[CELLS_HEADER + places + sensors] = place
                cells[CELLS_HEADER + 2 * places + sensors] = code == _TARGET_SENSOR
                robot[sensor_start + 2 * sensors] = x
                robot[sensor_start + 2 * sensors + 1] = y
                sensors += 1
            if _is_exposed(body, row, column):
                robot[exposed_start + 2 * exposed] = x
                robot[exposed_start + 2 * exposed + 1] = y
                exposed += 1
    cells[CELLS_GRID_SIZE] = n
    cells[CELLS_WHEELS] = wheels
    cells[CELLS_SENSORS] = sensors
    cells[CELLS_EXPOSED] = exposed
    robot[ROBOT_INVERSE_MASS] = 1.0 / mass
    robot[ROBOT_INVERSE_INERTIA] = 1.0 / inertia
    robot[ROBOT_CENTER_X] = center_x
    robot[ROBOT_CENTER_Y] = center_y
    robot[ROBOT_RADIUS] = radius
    _prepare_wheels(robot, wheels, mass, inertia)


@kernel
def _prepare_wheels(robot: NDArray[np.float64], wheels: int, mass: float, inertia: float) -> None:
    """Turn wheel positions into twist changes per unit of gas, and fill the damping.

    With ``M = diag(mass, mass, inertia)``, damping ``D`` and thrust ``T`` a step changes the
    body-frame twist by ``dt K^-1 (T g - D u)``: explicitly with ``K = M``, implicitly with
    ``K = M + dt D`` (see ``physics.wheel_model``). The rows of ``D`` here are those of the sums
    over wheels at (x, y) of ``20 (0, 1, x)^T (0, 1, x) + 100 (1, 0, -y)^T (1, 0, -y)``.
    """
    xx = wheels * WHEEL_SIDE_FRICTION
    yy = wheels * WHEEL_FORWARD_FRICTION
    x_turn = 0.0
    y_turn = 0.0
    turn = 0.0
    for wheel in range(wheels):
        x = robot[ROBOT_HEADER + 3 * wheel]
        y = robot[ROBOT_HEADER + 3 * wheel + 1]
        x_turn -= WHEEL_SIDE_FRICTION * y
        y_turn += WHEEL_FORWARD_FRICTION * x
        turn += WHEEL_FORWARD_FRICTION * x * x + WHEEL_SIDE_FRICTION * y * y
    # The rates are the eigenvalues of M^-1 D. All are stable where limit * M - D is positive
    # semidefinite, which for a matrix of this shape its diagonal and Schur complement decide.
    p = _LARGEST_STABLE_RATE * mass - xx
    q = _LARGEST_STABLE_RATE * mass - yy
    r = _LARGEST_STABLE_RATE * inertia - turn
    stable = p >= 0.0 and q >= 0.0 and p * q * r >= x_turn * x_turn * q + y_turn * y_turn * p
    stable = stable and r >= 0.0
    share = 0.0 if stable else DT
    k_xx = mass + share * xx
    k_yy = mass + share * yy
    k_x = share * x_turn
    k_y = share * y_turn
    # K has no xy entry; the rotation is solved first, from the Schur complement.
    schur = inertia + share * turn - k_x * k_x / k_xx - k_y * k_y / k_yy
    for column in range(3):
        d_x = xx if column == 0 else (0.0 if column == 1 else x_turn)
        d_y = yy if column == 1 else (0.0 if column == 0 else y_turn)
        d_turn = x_turn if column == 0 else (y_turn if column == 1 else turn)
        omega = (d_turn - k_x * d_x / k_xx - k_y * d_y / k_yy) / schur
        robot[ROBOT_DAMPING + column] = DT * (d_x - k_x * omega) / k_xx
        robot[ROBOT_DAMPING + 3 + column] = DT * (d_y - k_y * omega) / k_yy
        robot[ROBOT_DAMPING + 6 + column] = DT * omega
    for wheel in range(wheels):
        start = ROBOT_HEADER + 3 * wheel
        omega = WHEEL_THRUST * (robot[start] - k_y / k_yy) / schur
        robot[start] = DT * (-k_x * omega) / k_xx
        robot[start + 1] = DT * (WHEEL_THRUST - k_y * omega) / k_yy
        robot[start + 2] = DT * omega
