"""Task settings, scenarios and bodies as the records that kernels take."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.dtypes import column, records
from ncrs_envs.batched.layout import (
    Edge,
    Point,
    Quad,
    Robots,
    Scenarios,
    Settings,
    World,
    Worlds,
    make_robots,
    make_scenarios,
    make_scratch,
)
from ncrs_envs.batched.robot import prepare_robots
from ncrs_envs.batched.simulate import make_world
from ncrs_envs.scenario import MIN_QUAD_SIDE, Scenario, wall_quads
from ncrs_envs.scenario import Point as Place
from ncrs_envs.tasks import TaskSettings, playfield

_NOWHERE = (np.nan, np.nan)


def settings_record(task: TaskSettings) -> Settings:
    """Return the record of a task's settings."""
    settings: Settings = records(Settings, 1)[0]
    settings.extent = playfield(task.grid_size)
    settings.inverse_square = task.distance_score == "inverse_square"
    settings.success_radius = task.radius
    settings.has_ball = task.task.has_ball
    return settings


def robot_records(bodies: NDArray[np.int8]) -> Robots:
    """Return the records of many bodies, shape ``(bodies, n, n)``, none of them empty."""
    robots = make_robots(len(bodies), bodies.shape[-1])
    prepare_robots(bodies, robots)
    return robots


def quad_capacity(scenarios: Sequence[Scenario]) -> int:
    """Return the maximum number of wall quads of any scenario."""
    return max(
        (sum(len(line) - 1 for line in s.walls) for s in scenarios if s.walls is not None),
        default=0,
    )


def scenario_records(scenarios: Sequence[Scenario], grid_size: int) -> Scenarios:
    """Return the records of many scenarios, with room for the wall quads of each of them.

    Args:
        scenarios: Checked placements, all of the same task.
        grid_size: Side of the body grid, which determines the extent of the walls.
    """
    rows = make_scenarios(len(scenarios), quad_capacity(scenarios))
    _place(rows, "start", [s.start for s in scenarios])
    _place(rows, "goal", [s.ball if s.light is None else s.light for s in scenarios])
    _place(rows, "target", [s.target for s in scenarios])
    for i, scenario in enumerate(scenarios):
        if scenario.walls is not None:
            walls = wall_quads(scenario, grid_size)
            rows.scenarios[i].quad_count = prepare_walls(walls, rows.quads[i])
    return rows


def _place(rows: Scenarios, name: str, places: Sequence[Place | None]) -> None:
    """Write one place of all scenarios, a whole column at a time: thousands are drawn at once."""
    points = np.array([place or _NOWHERE for place in places], dtype=np.float64).reshape(-1, 2)
    column(rows.scenarios, f"{name}_x")[:] = points[:, 0]
    column(rows.scenarios, f"{name}_y")[:] = points[:, 1]


def single_world(settings: TaskSettings, body: NDArray[np.int8], scenario: Scenario) -> World:
    """Return the world of one episode: a checked body in a checked scenario."""
    n = settings.grid_size
    worlds = Worlds(
        settings_record(settings),
        robot_records(body[None]),
        scenario_records([scenario], n),
        make_scratch(n),
    )
    return make_world(worlds, 0, 0)


@kernel
def prepare_walls(walls: NDArray[np.float64], quads: NDArray[Quad]) -> int:
    """Write wall quads in order of increasing lower edge, and return their number.

    Each is replaced by its convex hull, since a vertex that lies beyond the wall's outer side makes
    the quad cross itself. Flat quads are omitted.

    Args:
        walls: Corners, shape ``(quads, 4, 2)``, from ``scenario.wall_quads``.
        quads: Output, with room for as many.
    """
    count = 0
    for i in range(len(walls)):
        low_x, low_y, high_x, high_y = _box(walls[i])
        if min(high_x - low_x, high_y - low_y) <= MIN_QUAD_SIDE:
            continue
        # Sorted by insertion, each by its index for the time being.
        place = count
        while place > 0 and quads[place - 1].low_y > low_y:
            quads[place].low_y = quads[place - 1].low_y
            quads[place].corner_count = quads[place - 1].corner_count
            place -= 1
        quads[place].low_y = low_y
        quads[place].corner_count = i
        count += 1
    for place in range(count):
        quad: Quad = quads[place]
        corners = walls[quad.corner_count]
        quad.low_x, quad.low_y, quad.high_x, quad.high_y = _box(corners)
        _write_hull(corners, quad)
    return count


@kernel
def _box(corners: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Return the bounding box of four points: low x, low y, high x, high y."""
    low_x = high_x = corners[0, 0]
    low_y = high_y = corners[0, 1]
    for corner in range(1, 4):
        low_x = min(low_x, corners[corner, 0])
        high_x = max(high_x, corners[corner, 0])
        low_y = min(low_y, corners[corner, 1])
        high_y = max(high_y, corners[corner, 1])
    return low_x, low_y, high_x, high_y


@kernel
def _write_hull(points: NDArray[np.float64], quad: Quad) -> None:
    """Write the convex hull of four points, counter-clockwise, and its edges.

    The corners are found by gift wrapping, from the lowest point on.
    """
    first = 0
    for corner in range(1, 4):
        lower = points[corner, 1] < points[first, 1]
        level = points[corner, 1] == points[first, 1] and points[corner, 0] > points[first, 0]
        if lower or level:
            first = corner
    current = first
    count = 0
    while count < 4:
        point: Point = quad.corners[count]
        point.x = points[current, 0]
        point.y = points[current, 1]
        count += 1
        following = 0 if current != 0 else 1
        for corner in range(4):
            if corner == current:
                continue
            a_x = points[following, 0] - points[current, 0]
            a_y = points[following, 1] - points[current, 1]
            b_x = points[corner, 0] - points[current, 0]
            b_y = points[corner, 1] - points[current, 1]
            cross = a_x * b_y - a_y * b_x
            further = cross == 0.0 and b_x * b_x + b_y * b_y > a_x * a_x + a_y * a_y
            if cross < 0.0 or further:
                following = corner
        current = following
        if current == first:
            break
    quad.corner_count = count
    for corner in range(count):
        begin: Point = quad.corners[corner]
        end: Point = quad.corners[corner + 1 if corner + 1 < count else 0]
        n_x = end.y - begin.y
        n_y = begin.x - end.x
        length = (n_x * n_x + n_y * n_y) ** 0.5
        if length > 0.0:
            n_x /= length
            n_y /= length
        edge: Edge = quad.edges[corner]
        edge.n_x = n_x
        edge.n_y = n_y
        edge.offset = n_x * begin.x + n_y * begin.y
