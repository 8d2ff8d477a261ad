"""The first time in a step at which the robot meets the light or a wall, along separating axes.

Static things are solid to a robot of any speed: the step is cut where it first touches one.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.geometry import (
    HALF_CELL,
    face_of_cell,
    quad_to_cell_frame,
    separation_along_cell,
    separation_along_quad,
    separation_from_point,
)
from ncrs_envs.batched.layout import (
    CELLS_EXPOSED,
    CELLS_GRID_SIZE,
    QUAD_CORNERS,
    QUAD_POINTS,
    QUAD_SIZE,
    ROBOT_HEADER,
    ROBOT_RADIUS,
    SCENARIO_HEADER,
    SCENARIO_SEEN_X,
    SCENARIO_SEEN_Y,
    STATE_ANGLE,
    STATE_X,
    STATE_Y,
)
from ncrs_envs.batched.manifolds import LINEAR_SLOP, SKIN, distance_from_quad
from ncrs_envs.physics import LIGHT_RADIUS

NO_QUAD = -1
"""In place of a quad's index: the light."""

Pose = tuple[float, float, float]

# Box2D stops bodies where their skins overlap by three slops, and calls it a touch slightly before.
_TARGET_OVERLAP = 3.0 * LINEAR_SLOP
_TOLERANCE = 0.25 * LINEAR_SLOP
_MAX_AXES = 20
_MAX_ROOT_ITERATIONS = 50
_HALF_DIAGONAL = HALF_CELL * 2.0**0.5


@kernel
def _separate(
    scenario: NDArray[np.float64],
    quad: int,
    x: float,
    y: float,
    cos: float,
    sin: float,
    scratch: NDArray[np.float64],
) -> tuple[float, float, float, float]:
    """Separation of a cell's core from a quad's core or the light's centre, and its axis.

    The axis is a face of the cell, or a world direction from what it separates to the cell.

    Returns:
        ``(separation, face, n_x, n_y)``, with ``face`` negative for a world direction.
    """
    if quad == NO_QUAD:
        from_x = scenario[SCENARIO_SEEN_X] - x
        from_y = scenario[SCENARIO_SEEN_Y] - y
        scratch[0] = cos * from_x + sin * from_y
        scratch[1] = cos * from_y - sin * from_x
        distance, n_x, n_y = separation_from_point(scratch[0], scratch[1])
        if n_x == 0.0 or n_y == 0.0:
            distance, _, _, face = separation_along_cell(scratch, 1)
            return distance, face, 0.0, 0.0
        return distance, -1.0, cos * n_x - sin * n_y, sin * n_x + cos * n_y
    distance, n_x, n_y, _ = separation_along_quad(scenario, quad, x, y, cos, sin)
    corners = quad_to_cell_frame(scenario, quad, x, y, cos, sin, scratch)
    by_cell, _, _, face = separation_along_cell(scratch, corners)
    if by_cell > distance:
        return by_cell, face, 0.0, 0.0
    return distance, -1.0, cos * n_x - sin * n_y, sin * n_x + cos * n_y


@kernel
def _separation_along(
    scenario: NDArray[np.float64],
    quad: int,
    x: float,
    y: float,
    cos: float,
    sin: float,
    face: float,
    n_x: float,
    n_y: float,
) -> float:
    """Separation of a cell from a quad or the light's centre along one axis of ``_separate``."""
    if face >= 0.0:
        f_x, f_y = face_of_cell(int(face))
        n_x = cos * f_x - sin * f_y
        n_y = sin * f_x + cos * f_y
        least = math.inf
        if quad == NO_QUAD:
            least = n_x * (scenario[SCENARIO_SEEN_X] - x) + n_y * (scenario[SCENARIO_SEEN_Y] - y)
        else:
            for corner in range(int(scenario[quad + QUAD_CORNERS])):
                from_x = scenario[quad + QUAD_POINTS + 2 * corner] - x
                from_y = scenario[quad + QUAD_POINTS + 2 * corner + 1] - y
                least = min(least, n_x * from_x + n_y * from_y)
        return least - HALF_CELL
    largest = -math.inf
    if quad == NO_QUAD:
        largest = n_x * scenario[SCENARIO_SEEN_X] + n_y * scenario[SCENARIO_SEEN_Y]
    else:
        for corner in range(int(scenario[quad + QUAD_CORNERS])):
            corner_x = scenario[quad + QUAD_POINTS + 2 * corner]
            corner_y = scenario[quad + QUAD_POINTS + 2 * corner + 1]
            largest = max(largest, n_x * corner_x + n_y * corner_y)
    own_x = cos * n_x + sin * n_y
    own_y = cos * n_y - sin * n_x
    return n_x * x + n_y * y - HALF_CELL * (abs(own_x) + abs(own_y)) - largest


@kernel
def _cell_at(
    robot_from: Pose, move: Pose, time: float, cell_x: float, cell_y: float
) -> tuple[float, float, float, float]:
    """Centre of a cell and cosine and sine of its angle after a part of the move."""
    angle = robot_from[2] + time * move[2]
    cos = math.cos(angle)
    sin = math.sin(angle)
    x = robot_from[0] + time * move[0] + cos * cell_x - sin * cell_y
    y = robot_from[1] + time * move[1] + sin * cell_x + cos * cell_y
    return x, y, cos, sin


@kernel
def _time_of_cell(
    scenario: NDArray[np.float64],
    quad: int,
    robot_from: Pose,
    move: Pose,
    cell_x: float,
    cell_y: float,
    latest: float,
    scratch: NDArray[np.float64],
    ignore_touching: bool,
) -> float:
    """Part of the move after which a cell touches, at most ``latest``.

    Where the present separating axis still separates at the end, the cell is free. Otherwise the
    time at which it ceases to is a time of touch if no other axis separates then.
    """
    radii = LIGHT_RADIUS + SKIN if quad == NO_QUAD else 2.0 * SKIN
    target = radii - _TARGET_OVERLAP
    time = 0.0
    for _ in range(_MAX_AXES):
        x, y, cos, sin = _cell_at(robot_from, move, time, cell_x, cell_y)
        distance, face, n_x, n_y = _separate(scenario, quad, x, y, cos, sin, scratch)
        if distance < target + _TOLERANCE:
            is_left_out = time == 0.0 and (distance <= 0.0 or ignore_touching)
            return latest if is_left_out else min(time, latest)
        free = time
        blocked = 1.0
        x, y, cos, sin = _cell_at(robot_from, move, blocked, cell_x, cell_y)
        end = _separation_along(scenario, quad, x, y, cos, sin, face, n_x, n_y)
        if end > target - _TOLERANCE:
            return latest
        begin = distance
        for iteration in range(_MAX_ROOT_ITERATIONS):
            # Bisection and the secant rule in turn: one is safe, the other fast.
            if iteration % 2 == 1:
                time = 0.5 * (free + blocked)
            else:
                time = free + (target - begin) * (blocked - free) / (end - begin)
            x, y, cos, sin = _cell_at(robot_from, move, time, cell_x, cell_y)
            middle = _separation_along(scenario, quad, x, y, cos, sin, face, n_x, n_y)
            if abs(middle - target) < _TOLERANCE:
                break
            if middle > target:
                free = time
                begin = middle
            else:
                blocked = time
                end = middle
        if time >= latest:
            return latest
    return time


@kernel
def time_of_impact(
    robot: NDArray[np.float64],
    cells: NDArray[np.int32],
    scenario: NDArray[np.float64],
    near: tuple[int, int],
    state: NDArray[np.float64],
    robot_from: Pose,
    scratch: NDArray[np.float64],
    ignore_touching: bool,
) -> float:
    """Part of the move from ``robot_from`` to the state's pose that is free, 1 if all of it is.

    Overlaps at the start are left to the contact solver, as in Box2D.

    Args:
        robot: the robot's record.
        cells: the robot's indices.
        scenario: the run's scenario.
        near: which quads to look at, from ``manifolds.near_quads``.
        state: holds the pose at the end of the move.
        robot_from: centre of mass and angle at its start.
        scratch: its head is used.
        ignore_touching: leave out what touches at the start already.
    """
    move = (
        state[STATE_X] - robot_from[0],
        state[STATE_Y] - robot_from[1],
        state[STATE_ANGLE] - robot_from[2],
    )
    start = ROBOT_HEADER + 5 * cells[CELLS_GRID_SIZE] * cells[CELLS_GRID_SIZE]
    length = math.sqrt(move[0] * move[0] + move[1] * move[1])
    latest = 1.0
    away_x = scenario[SCENARIO_SEEN_X] - robot_from[0]
    away_y = scenario[SCENARIO_SEEN_Y] - robot_from[1]
    reach = robot[ROBOT_RADIUS] + length + LIGHT_RADIUS + SKIN
    if away_x * away_x + away_y * away_y <= reach * reach:
        for cell in range(cells[CELLS_EXPOSED]):
            cell_x = robot[start + 2 * cell]
            cell_y = robot[start + 2 * cell + 1]
            latest = _time_of_cell(
                scenario,
                NO_QUAD,
                robot_from,
                move,
                cell_x,
                cell_y,
                latest,
                scratch,
                ignore_touching,
            )
    reach = robot[ROBOT_RADIUS] + length + 2.0 * SKIN
    cos = math.cos(robot_from[2])
    sin = math.sin(robot_from[2])
    for i in range(near[0], near[1]):
        quad = SCENARIO_HEADER + QUAD_SIZE * i
        if distance_from_quad(scenario, quad, robot_from[0], robot_from[1]) > reach:
            continue
        for cell in range(cells[CELLS_EXPOSED]):
            cell_x = robot[start + 2 * cell]
            cell_y = robot[start + 2 * cell + 1]
            x = robot_from[0] + cos * cell_x - sin * cell_y
            y = robot_from[1] + sin * cell_x + cos * cell_y
            arc = abs(move[2]) * math.sqrt(cell_x * cell_x + cell_y * cell_y)
            cell_reach = _HALF_DIAGONAL + length + arc + 2.0 * SKIN
            if distance_from_quad(scenario, quad, x, y) <= cell_reach:
                latest = _time_of_cell(
                    scenario,
                    quad,
                    robot_from,
                    move,
                    cell_x,
                    cell_y,
                    latest,
                    scratch,
                    ignore_touching,
                )
    return latest
