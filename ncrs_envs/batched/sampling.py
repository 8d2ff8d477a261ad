"""Random scenarios for many episodes at once, equal to those of ``sample_scenario``.

Drawing thousands of scenarios one by one takes longer than simulating them, above all in Obstacle,
where each needs dozens of random numbers. Here compiled code reads each episode's random stream in
the order in which ``sample_scenario`` does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.layout import Quad, Scenarios, make_scenarios
from ncrs_envs.batched.layout import Scenario as ScenarioRecord
from ncrs_envs.batched.records import prepare_walls
from ncrs_envs.batched.streams import Stream, next_integer, next_number
from ncrs_envs.body import CELL_SIZE
from ncrs_envs.scenario import (
    COLUMN_REGIONS,
    CORNER_REGIONS,
    FAR,
    MAX_START_DRAWS,
    PASSAGE_HALF_WIDTH,
    PASSAGE_RANGE,
    START_Y,
    WALL_EXTENT,
    WALL_NOISE,
    WALL_TOP,
    WALL_VERTICES,
    Polyline,
    Scenario,
    ScenarioError,
)
from ncrs_envs.tasks import REGIONS, Task, playfield

MAX_QUADS = 2 * (WALL_VERTICES[1] - 2)
RANDOM_REGION = -1
"""Number in place of a region that is drawn, too."""
MAX_VERTICES = WALL_VERTICES[1] - 1
_FIXED_VERTICES = 2
"""Number of a wall's last vertices that form the passage and are not moved."""
_COLUMNS, _CORNERS = np.array(COLUMN_REGIONS), np.array(CORNER_REGIONS)


class Room(NamedTuple):
    """What placements depend on."""

    grid_size: int
    extent: float
    """Half the playfield's side, P."""
    noise: float


class Walls(NamedTuple):
    """Vertices of the walls of a scenario, from which its quads are made; or those of many."""

    counts: NDArray[np.int64]
    """Numbers of vertices of the left and the right wall, ``(2,)``."""
    vertices: NDArray[np.float64]
    """``(2, MAX_VERTICES, 2)``."""
    quads: NDArray[np.float64]
    """Room for the quads' corners while a scenario is drawn, ``(MAX_QUADS, 4, 2)``."""


def make_walls(count: int) -> Walls:
    """Return room for the vertices of the walls of many scenarios, and for the quads of one."""
    return Walls(
        np.empty((count, 2), dtype=np.int64),
        np.empty((count, 2, MAX_VERTICES, 2)),
        np.empty((MAX_QUADS, 4, 2)),
    )


def no_start(grid_size: int) -> ScenarioError:
    """Return the error for a scenario without a start that is free of walls."""
    return ScenarioError(
        f"No start free of walls in {MAX_START_DRAWS} draws for grid size {grid_size}."
    )


class Sample:
    """Scenarios of a task without placements of its own, each drawn from a stream of its own.

    Args:
        task: The task.
        streams: Streams, ``(scenarios, STREAM_SIZE)``, left as ``sample_scenario`` leaves them.
        regions: Region of each light or ball, 0 to 3, or ``RANDOM_REGION``, int64.
        grid_size: Side of the body grid.
        noise: Noise of the placements.

    Attributes:
        records: Records of the scenarios, with room for ``MAX_QUADS`` quads each if it has walls.

    Raises:
        ScenarioError: No start free of walls was found.
    """

    def __init__(
        self,
        task: Task,
        streams: NDArray[np.uint64],
        regions: NDArray[np.int64],
        grid_size: int,
        noise: float,
    ) -> None:
        count, room = len(streams), Room(grid_size, playfield(grid_size), noise)
        self._task = task
        self.records = make_scenarios(count, MAX_QUADS if task.has_walls else 0)
        if not task.has_walls:
            _draw_many_points(streams, regions, task.has_ball, room, self.records.scenarios)
            return
        self._walls = make_walls(count)
        if not _draw_many_obstacles(streams, regions, room, self._walls, self.records):
            raise no_start(grid_size)

    def __getitem__(self, index: int) -> Scenario:
        """Make the object of one scenario."""
        record: ScenarioRecord = self.records.scenarios[index]
        start = (float(record.start_x), float(record.start_y))
        goal = (float(record.goal_x), float(record.goal_y))
        if self._task.has_ball:
            return Scenario(start, ball=goal, target=(record.target_x, record.target_y))
        walls = (self._wall(index, 0), self._wall(index, 1)) if self._task.has_walls else None
        return Scenario(start, light=goal, walls=walls)

    def _wall(self, index: int, side: int) -> Polyline:
        """Return the inner edge of one wall of a scenario."""
        count = self._walls.counts[index, side]
        return tuple((x, y) for x, y in self._walls.vertices[index, side, :count].tolist())


@kernel
def _between(stream: Stream, reach: float) -> float:
    """Draw a number as ``Generator.uniform(-reach, reach)`` does."""
    return -reach + (reach - -reach) * next_number(stream)


@kernel
def _region(stream: Stream, given: int) -> int:
    return int(next_integer(stream, 0, REGIONS)) if given == RANDOM_REGION else given


@kernel
def draw_points(
    stream: Stream, region: int, has_ball: bool, room: Room, record: ScenarioRecord
) -> None:
    """Draw a scenario of a light or a ball in the open."""
    extent, noise = room.extent, room.noise
    chosen = _region(stream, region)
    noise_x = _between(stream, noise * extent)
    noise_y = _between(stream, noise * extent)
    if has_ball:
        record.start_x = _between(stream, FAR * extent)
        record.start_y = START_Y * extent
        record.goal_x = _COLUMNS[chosen] * extent + noise_x
        record.goal_y = noise_y
        record.target_x = _COLUMNS[next_integer(stream, 0, REGIONS)] * extent
        record.target_y = FAR * extent
    else:
        record.start_x = 0.0
        record.start_y = 0.0
        record.goal_x = _CORNERS[chosen, 0] * FAR * extent + noise_x
        record.goal_y = _CORNERS[chosen, 1] * FAR * extent + noise_y
        record.target_x = np.nan
        record.target_y = np.nan
    record.quad_count = 0


@kernel
def draw_obstacle(  # noqa: PLR0913 - inputs, and outputs
    stream: Stream,
    region: int,
    room: Room,
    walls: Walls,
    record: ScenarioRecord,
    quads: NDArray[Quad],
) -> bool:
    """Draw a scenario with walls, and return False if it has no start that is free of them."""
    grid_size, extent = room.grid_size, room.extent
    chosen = _region(stream, region)
    noise_x = _between(stream, room.noise * extent)
    noise_y = _between(stream, room.noise * extent)
    passage = _between(stream, PASSAGE_RANGE * extent)
    for side in range(2):
        count = next_integer(stream, WALL_VERTICES[0], WALL_VERTICES[1])
        walls.counts[side] = count
        vertices = walls.vertices[side, :count]
        _place_ends(grid_size, extent, passage, -1.0 if side == 0 else 1.0, vertices)
        _fill_wall(stream, grid_size, vertices)
    number = _write_quads(extent, walls.counts, walls.vertices, walls.quads)
    record.quad_count = prepare_walls(walls.quads[:number], quads)
    record.start_y = START_Y * extent
    record.goal_x = _COLUMNS[chosen] * extent + noise_x
    record.goal_y = FAR * extent + noise_y
    record.target_x = np.nan
    record.target_y = np.nan
    for _ in range(MAX_START_DRAWS):
        record.start_x = _between(stream, FAR * extent)
        if not _is_blocked(record.start_x, record.start_y, grid_size, walls.quads[:number]):
            return True
    return False


@kernel
def _draw_many_points(
    streams: NDArray[np.uint64],
    regions: NDArray[np.int64],
    has_ball: bool,
    room: Room,
    records: NDArray[ScenarioRecord],
) -> None:
    for i in range(len(streams)):
        draw_points(streams[i], regions[i], has_ball, room, records[i])


@kernel
def _draw_many_obstacles(
    streams: NDArray[np.uint64],
    regions: NDArray[np.int64],
    room: Room,
    walls: Walls,
    scenarios: Scenarios,
) -> bool:
    """Draw scenarios with walls, and return False if one of them has no free start."""
    for i in range(len(streams)):
        own = Walls(walls.counts[i], walls.vertices[i], walls.quads)
        record: ScenarioRecord = scenarios.scenarios[i]
        quads: NDArray[Quad] = scenarios.quads[i]
        if not draw_obstacle(streams[i], regions[i], room, own, record, quads):
            return False
    return True


@kernel
def _place_ends(
    grid_size: int, extent: float, passage: float, sign: float, vertices: NDArray[np.float64]
) -> None:
    """Set a wall's first vertex, at the lower corner, and its last, at the passage."""
    vertices[0, 0] = sign * WALL_EXTENT * extent
    vertices[0, 1] = -WALL_EXTENT * extent
    vertices[-1, 0] = passage + sign * PASSAGE_HALF_WIDTH * grid_size
    vertices[-1, 1] = WALL_TOP * grid_size


@kernel
def _fill_wall(stream: Stream, grid_size: int, vertices: NDArray[np.float64]) -> None:
    """Space vertices equally between a wall's ends, then move all but the last two."""
    count = len(vertices)
    bottom_x = vertices[0, 0]
    bottom_y = vertices[0, 1]
    step_x = (vertices[-1, 0] - bottom_x) / (count - 1)
    step_y = (vertices[-1, 1] - bottom_y) / (count - 1)
    reach = WALL_NOISE * grid_size
    for i in range(count - 1):
        vertices[i, 0] = i * step_x + bottom_x
        vertices[i, 1] = i * step_y + bottom_y
        if i < count - _FIXED_VERTICES:
            vertices[i, 0] += _between(stream, reach)
            vertices[i, 1] += _between(stream, reach)


@kernel
def _write_quads(
    extent: float,
    counts: NDArray[np.int64],
    vertices: NDArray[np.float64],
    quads: NDArray[np.float64],
) -> int:
    """Write the quads of both walls as in ``scenario.wall_quads``, and return their number."""
    number = 0
    for side in range(2):
        outside = WALL_EXTENT * extent if side == 1 else -WALL_EXTENT * extent
        for i in range(counts[side] - 1):
            for corner in range(4):
                vertex = vertices[side, i if corner < 2 else i + 1]
                is_outer = corner in (0, 3)
                quads[number, corner, 0] = outside if is_outer else vertex[0]
                quads[number, corner, 1] = vertex[1]
            number += 1
    return number


@kernel
def _is_blocked(x: float, y: float, grid_size: int, quads: NDArray[np.float64]) -> bool:
    """Return True if the grid's square overlaps any quad; see ``scenario.sample_scenario``."""
    half = grid_size * CELL_SIZE / 2.0
    for quad in quads:
        n_x = -(quad[2, 1] - quad[1, 1])
        n_y = quad[2, 0] - quad[1, 0]
        low_x = low_y = low = np.inf
        high_x = high_y = high = -np.inf
        for corner in range(4):
            along = quad[corner, 0] * n_x + quad[corner, 1] * n_y
            low_x = min(low_x, quad[corner, 0])
            high_x = max(high_x, quad[corner, 0])
            low_y = min(low_y, quad[corner, 1])
            high_y = max(high_y, quad[corner, 1])
            low = min(low, along)
            high = max(high, along)
        middle = x * n_x + y * n_y
        reach = half * (abs(n_x) + abs(n_y))
        if (
            low_x < x + half
            and high_x > x - half
            and low_y < y + half
            and high_y > y - half
            and low < middle + reach
            and high > middle - reach
        ):
            return True
    return False
