"""Task settings, scenarios and bodies as the arrays that kernels take."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.layout import (
    QUAD_CORNERS,
    QUAD_EDGES,
    QUAD_HIGH_X,
    QUAD_HIGH_Y,
    QUAD_LOW_X,
    QUAD_LOW_Y,
    QUAD_POINTS,
    QUAD_SIZE,
    SCENARIO_HEADER,
    SCENARIO_QUADS,
    SCENARIO_SEEN_X,
    SCENARIO_START_X,
    SCENARIO_TARGET_X,
    SETTING_EXTENT,
    SETTING_HAS_BALL,
    SETTING_INVERSE_SQUARE,
    SETTING_SUCCESS_RADIUS,
    SETTINGS_SIZE,
    cells_size,
    robot_size,
    scenario_size,
)
from ncrs_envs.batched.robot import prepare_robot
from ncrs_envs.scenario import MIN_QUAD_SIDE, Scenario, wall_quads
from ncrs_envs.tasks import TaskSettings, playfield


def settings_array(task: TaskSettings) -> NDArray[np.float64]:
    """A task's settings as float64 ``(SETTINGS_SIZE,)``."""
    settings = np.zeros(SETTINGS_SIZE)
    settings[SETTING_EXTENT] = playfield(task.grid_size)
    settings[SETTING_INVERSE_SQUARE] = task.distance_score == "inverse_square"
    settings[SETTING_SUCCESS_RADIUS] = task.radius
    settings[SETTING_HAS_BALL] = task.task.has_ball
    return settings


def robot_arrays(bodies: NDArray[np.int8]) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Records of many bodies, shape ``(bodies, n, n)``, each with at least one cell.

    Returns:
        float64 ``(bodies, robot_size(n))`` and int32 ``(bodies, cells_size(n))``.
    """
    n = bodies.shape[-1]
    robots = np.zeros((len(bodies), robot_size(n)))
    cells = np.zeros((len(bodies), cells_size(n)), dtype=np.int32)
    for body, robot, indices in zip(bodies, robots, cells, strict=True):
        prepare_robot(body, robot, indices)
    return robots, cells


def quad_capacity(scenarios: Sequence[Scenario]) -> int:
    """The largest number of wall quads of any of these scenarios."""
    return max(
        (sum(len(line) - 1 for line in s.walls) for s in scenarios if s.walls is not None),
        default=0,
    )


def scenario_arrays(
    scenarios: Sequence[Scenario], grid_size: int, quads: int | None = None
) -> NDArray[np.float64]:
    """Records of many scenarios, float64, shape ``(scenarios, scenario_size(quads))``.

    Args:
        scenarios: placements, already checked; all of the same task.
        grid_size: side of the body grid, which says how far walls reach.
        quads: room for this many wall quads each; by default as many as the largest needs.
    """
    if quads is None:
        quads = quad_capacity(scenarios)
    rows = np.empty((len(scenarios), scenario_size(quads)))
    for row, scenario in zip(rows, scenarios, strict=True):
        row[:SCENARIO_HEADER] = np.nan
        row[SCENARIO_QUADS] = 0.0
        _place(row, SCENARIO_START_X, scenario.start)
        _place(row, SCENARIO_SEEN_X, scenario.ball if scenario.light is None else scenario.light)
        _place(row, SCENARIO_TARGET_X, scenario.target)
        if scenario.walls is not None:
            prepare_walls(wall_quads(scenario, grid_size), row)
    return rows


def _place(row: NDArray[np.float64], index: int, point: Any) -> None:
    if point is not None:
        row[index], row[index + 1] = point


@kernel
def prepare_walls(quads: NDArray[np.float64], scenario: NDArray[np.float64]) -> None:
    """Write wall quads into a scenario's record, in order of increasing lower edge.

    Each is replaced by its convex hull, since a vertex that lies beyond the wall's outer side makes
    the quad cross itself.

    Args:
        quads: shape ``(quads, 4, 2)``, from ``scenario.wall_quads``.
        scenario: the record, with room for that many.
    """
    count = 0
    for quad in quads:
        low_x = high_x = quad[0, 0]
        low_y = high_y = quad[0, 1]
        for corner in range(1, 4):
            low_x = min(low_x, quad[corner, 0])
            high_x = max(high_x, quad[corner, 0])
            low_y = min(low_y, quad[corner, 1])
            high_y = max(high_y, quad[corner, 1])
        if min(high_x - low_x, high_y - low_y) <= MIN_QUAD_SIDE:
            continue
        place = count
        while place > 0 and scenario[_quad(place - 1) + QUAD_LOW_Y] > low_y:
            for i in range(QUAD_SIZE):
                scenario[_quad(place) + i] = scenario[_quad(place - 1) + i]
            place -= 1
        record = scenario[_quad(place) : _quad(place + 1)]
        record[QUAD_LOW_X] = low_x
        record[QUAD_HIGH_X] = high_x
        record[QUAD_LOW_Y] = low_y
        record[QUAD_HIGH_Y] = high_y
        _write_hull(quad, record)
        count += 1
    scenario[SCENARIO_QUADS] = count


@kernel
def _quad(index: int) -> int:
    return SCENARIO_HEADER + QUAD_SIZE * index


@kernel
def _write_hull(quad: NDArray[np.float64], record: NDArray[np.float64]) -> None:
    """The convex hull of four points, counter-clockwise, by gift wrapping from the lowest, and its
    edges."""
    first = 0
    for corner in range(1, 4):
        lower = quad[corner, 1] < quad[first, 1]
        level = quad[corner, 1] == quad[first, 1] and quad[corner, 0] > quad[first, 0]
        if lower or level:
            first = corner
    current = first
    count = 0
    while count < 4:
        record[QUAD_POINTS + 2 * count] = quad[current, 0]
        record[QUAD_POINTS + 2 * count + 1] = quad[current, 1]
        count += 1
        following = 0 if current != 0 else 1
        for corner in range(4):
            if corner == current:
                continue
            a_x = quad[following, 0] - quad[current, 0]
            a_y = quad[following, 1] - quad[current, 1]
            b_x = quad[corner, 0] - quad[current, 0]
            b_y = quad[corner, 1] - quad[current, 1]
            cross = a_x * b_y - a_y * b_x
            further = cross == 0.0 and b_x * b_x + b_y * b_y > a_x * a_x + a_y * a_y
            if cross < 0.0 or further:
                following = corner
        current = following
        if current == first:
            break
    record[QUAD_CORNERS] = count
    for corner in range(count):
        point = QUAD_POINTS + 2 * corner
        following = point + 2 if corner + 1 < count else QUAD_POINTS
        n_x = record[following + 1] - record[point + 1]
        n_y = record[point] - record[following]
        length = (n_x * n_x + n_y * n_y) ** 0.5
        if length > 0.0:
            n_x /= length
            n_y /= length
        edge = QUAD_EDGES + 3 * corner
        record[edge] = n_x
        record[edge + 1] = n_y
        record[edge + 2] = n_x * record[point] + n_y * record[point + 1]
