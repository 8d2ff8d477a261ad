"""Random Obstacle scenarios for many runs at once, the same as ``sample_scenario`` draws.

An Obstacle scenario has dozens of random numbers, so that drawing thousands one by one takes longer
than simulating them. Here each run's generator only fills arrays, in the order in which
``sample_scenario`` uses it, and compiled code does the rest.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.layout import (
    SCENARIO_SEEN_X,
    SCENARIO_SEEN_Y,
    SCENARIO_START_X,
    SCENARIO_START_Y,
    SCENARIO_TARGET_X,
    SCENARIO_TARGET_Y,
)
from ncrs_envs.batched.records import prepare_walls
from ncrs_envs.body import CELL_SIZE
from ncrs_envs.scenario import (
    COLUMN_REGIONS,
    FAR,
    MAX_START_DRAWS,
    NOISE,
    PASSAGE_HALF_WIDTH,
    PASSAGE_RANGE,
    START_Y,
    WALL_EXTENT,
    WALL_NOISE,
    WALL_TOP,
    WALL_VERTICES,
    Polyline,
    ScenarioError,
)
from ncrs_envs.tasks import REGIONS, playfield

MAX_VERTICES = WALL_VERTICES[1] - 1
MAX_QUADS = 2 * (MAX_VERTICES - 1)
_FIXED_VERTICES = 2
"""The last vertices of a wall, which form the passage, are not moved."""
_COLUMNS = np.array(COLUMN_REGIONS)


class ObstacleDraws:
    """Obstacle scenarios of some runs.

    Args:
        generators: one for each run; each is left as ``sample_scenario`` would leave it.
        regions: where each light stands, 0 to 3, or None for a uniformly random one.
        grid_size: side of the body grid.
        records: output, float64 ``(runs, scenario_size(MAX_QUADS))``; kept.

    Attributes:
        vertices: of the left and the right wall, shape ``(runs, 2, MAX_VERTICES, 2)``.
        counts: numbers of vertices, shape ``(runs, 2)``.

    Raises:
        ScenarioError: no start free of walls was found.
    """

    def __init__(
        self,
        generators: Sequence[np.random.Generator],
        regions: Sequence[int | None],
        grid_size: int,
        records: NDArray[np.float64],
    ) -> None:
        runs = len(generators)
        chosen = np.empty(runs, dtype=np.int64)
        places = np.empty((runs, 3))
        starts = np.empty(runs)
        noise = np.empty((runs, 2, 2 * MAX_VERTICES))
        self.counts = np.empty((runs, 2), dtype=np.int64)
        self.vertices = np.zeros((runs, 2, MAX_VERTICES, 2))
        self.records = records
        for run, (generator, region) in enumerate(zip(generators, regions, strict=True)):
            chosen[run] = generator.integers(REGIONS) if region is None else region
            generator.random(out=places[run])
            for side in range(2):
                count = int(generator.integers(*WALL_VERTICES))
                self.counts[run, side] = count
                generator.random(out=noise[run, side, : 2 * (count - _FIXED_VERTICES)])
            starts[run] = generator.random()
        extent = playfield(grid_size)
        blocked = np.empty(runs, dtype=np.bool_)
        _build(
            grid_size, extent, chosen, places, starts, noise,
            self.counts, self.vertices, self.records, blocked,
        )  # fmt: skip
        for run in np.flatnonzero(blocked).tolist():
            self._draw_start_again(run, generators[run], grid_size, extent)

    def _draw_start_again(
        self, run: int, generator: np.random.Generator, grid_size: int, extent: float
    ) -> None:
        quads = np.empty((MAX_QUADS, 4, 2))
        count = _write_quads(extent, self.counts[run], self.vertices[run], quads)
        for _ in range(MAX_START_DRAWS - 1):
            x = _between(-FAR * extent, FAR * extent, generator.random())
            if not _is_blocked(x, START_Y * extent, grid_size, quads[:count]):
                self.records[run, SCENARIO_START_X] = x
                return
        raise ScenarioError(
            f"No start free of walls in {MAX_START_DRAWS} draws for grid size {grid_size}."
        )

    def walls(self, run: int) -> tuple[Polyline, Polyline]:
        """Edges of the left and the right wall of one run."""
        left, right = (
            tuple((float(x), float(y)) for x, y in self.vertices[run, side, :count])
            for side, count in enumerate(self.counts[run])
        )
        return left, right


@kernel
def _between(low: float, high: float, share: float) -> float:
    """The number that ``Generator.uniform(low, high)`` makes of one in [0, 1)."""
    return low + (high - low) * share


@kernel
def _build(
    grid_size: int,
    extent: float,
    regions: NDArray[np.int64],
    places: NDArray[np.float64],
    starts: NDArray[np.float64],
    noise: NDArray[np.float64],
    counts: NDArray[np.int64],
    vertices: NDArray[np.float64],
    records: NDArray[np.float64],
    blocked: NDArray[np.bool_],
) -> None:
    """Make scenarios of random numbers in [0, 1), and say whose start is not free of walls."""
    quads = np.empty((MAX_QUADS, 4, 2))
    for run in range(len(regions)):
        record = records[run]
        noise_x = _between(-NOISE * extent, NOISE * extent, places[run, 0])
        noise_y = _between(-NOISE * extent, NOISE * extent, places[run, 1])
        passage = _between(-PASSAGE_RANGE * extent, PASSAGE_RANGE * extent, places[run, 2])
        record[SCENARIO_START_X] = _between(-FAR * extent, FAR * extent, starts[run])
        record[SCENARIO_START_Y] = START_Y * extent
        record[SCENARIO_SEEN_X] = _COLUMNS[regions[run]] * extent + noise_x
        record[SCENARIO_SEEN_Y] = FAR * extent + noise_y
        record[SCENARIO_TARGET_X] = np.nan
        record[SCENARIO_TARGET_Y] = np.nan
        for side in range(2):
            _write_wall(
                grid_size, extent, passage, -1.0 if side == 0 else 1.0,
                counts[run, side], noise[run, side], vertices[run, side],
            )  # fmt: skip
        count = _write_quads(extent, counts[run], vertices[run], quads)
        prepare_walls(quads[:count], record)
        blocked[run] = _is_blocked(
            record[SCENARIO_START_X], record[SCENARIO_START_Y], grid_size, quads[:count]
        )


@kernel
def _write_wall(
    grid_size: int,
    extent: float,
    passage: float,
    sign: float,
    count: int,
    noise: NDArray[np.float64],
    vertices: NDArray[np.float64],
) -> None:
    """Equally spaced vertices from the lower corner to the passage, all but the last two moved."""
    bottom_x = sign * WALL_EXTENT * extent
    bottom_y = -WALL_EXTENT * extent
    top_x = passage + sign * PASSAGE_HALF_WIDTH * grid_size
    top_y = WALL_TOP * grid_size
    step_x = (top_x - bottom_x) / (count - 1)
    step_y = (top_y - bottom_y) / (count - 1)
    reach = WALL_NOISE * grid_size
    for i in range(count - 1):
        vertices[i, 0] = i * step_x + bottom_x
        vertices[i, 1] = i * step_y + bottom_y
        if i < count - _FIXED_VERTICES:
            vertices[i, 0] += _between(-reach, reach, noise[2 * i])
            vertices[i, 1] += _between(-reach, reach, noise[2 * i + 1])
    vertices[count - 1, 0] = top_x
    vertices[count - 1, 1] = top_y


@kernel
def _write_quads(
    extent: float,
    counts: NDArray[np.int64],
    vertices: NDArray[np.float64],
    quads: NDArray[np.float64],
) -> int:
    """As ``scenario.wall_quads``; returns their number."""
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
    """Whether the grid's square overlaps any quad; see ``scenario.sample_scenario``."""
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
