"""Random Obstacle scenarios for many episodes at once, equal to those of ``sample_scenario``.

An Obstacle scenario needs dozens of random numbers, so drawing thousands of scenarios one by one
takes longer than simulating them. Here each episode's generator only fills arrays, in the order in
which ``sample_scenario`` uses it, and compiled code does the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.layout import Scenario as ScenarioRecord
from ncrs_envs.batched.layout import Scenarios, make_scenarios
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
FIXED_VERTICES = 2
"""Number of a wall's last vertices that form the passage and are not moved."""
COLUMNS = np.array(COLUMN_REGIONS)


class Draws(NamedTuple):
    """Random numbers in [0, 1) for scenarios, and the walls' vertices made from them."""

    regions: NDArray[np.int64]
    """Region of each light, 0 to 3."""
    places: NDArray[np.float64]
    """For the positions of light (x, y) and passage (x), ``(episodes, 3)``."""
    starts: NDArray[np.float64]
    noise: NDArray[np.float64]
    """For the vertices of the left and the right wall, ``(episodes, 2, 2 * MAX_VERTICES)``."""
    counts: NDArray[np.int64]
    """Numbers of vertices, ``(episodes, 2)``."""
    vertices: NDArray[np.float64]
    """Output, ``(episodes, 2, MAX_VERTICES, 2)``."""


def make_draws(count: int) -> Draws:
    """Return arrays for the random numbers of so many scenarios."""
    return Draws(
        regions=np.empty(count, dtype=np.int64),
        places=np.empty((count, 3)),
        starts=np.empty(count),
        noise=np.empty((count, 2, 2 * MAX_VERTICES)),
        counts=np.empty((count, 2), dtype=np.int64),
        vertices=np.zeros((count, 2, MAX_VERTICES, 2)),
    )


def no_free_start(grid_size: int) -> ScenarioError:
    """Return the error of a scenario that leaves the robot no room to start."""
    return ScenarioError(
        f"No start free of walls in {MAX_START_DRAWS} draws for grid size {grid_size}."
    )


class ObstacleDraws:
    """Random Obstacle scenarios, one for each generator.

    Args:
        generators: Source of each scenario, left in the state that ``sample_scenario`` leaves.
        regions: Region of each light, 0 to 3, or None for a uniformly random one.
        grid_size: Side of the body grid.

    Attributes:
        records: Records of the scenarios, with room for ``MAX_QUADS`` quads each.

    Raises:
        ScenarioError: No start free of walls was found.
    """

    def __init__(
        self,
        generators: Sequence[np.random.Generator],
        regions: Sequence[int | None],
        grid_size: int,
    ) -> None:
        count = len(generators)
        self.records = make_scenarios(count, MAX_QUADS)
        self._draws = draws = make_draws(count)
        for i, (generator, region) in enumerate(zip(generators, regions, strict=True)):
            draws.regions[i] = generator.integers(REGIONS) if region is None else region
            generator.random(out=draws.places[i])
            for side in range(2):
                vertices = int(generator.integers(*WALL_VERTICES))
                draws.counts[i, side] = vertices
                generator.random(out=draws.noise[i, side, : 2 * (vertices - FIXED_VERTICES)])
            draws.starts[i] = generator.random()
        extent = playfield(grid_size)
        blocked = np.empty(count, dtype=np.bool_)
        build_obstacles(grid_size, extent, NOISE, draws, self.records, blocked)
        for i in np.flatnonzero(blocked).tolist():
            self._draw_start_again(i, generators[i], grid_size, extent)

    def _draw_start_again(
        self, index: int, generator: np.random.Generator, grid_size: int, extent: float
    ) -> None:
        quads = np.empty((MAX_QUADS, 4, 2))
        count = write_quads(extent, self._draws.counts[index], self._draws.vertices[index], quads)
        for _ in range(MAX_START_DRAWS - 1):
            x = between(-FAR * extent, FAR * extent, generator.random())
            if not is_blocked(x, START_Y * extent, grid_size, quads[:count]):
                self.records.scenarios[index].start_x = x
                return
        raise no_free_start(grid_size)

    def walls(self, index: int) -> tuple[Polyline, Polyline]:
        """Return the inner edges of the left and the right wall of one scenario."""
        left, right = (
            tuple((float(x), float(y)) for x, y in self._draws.vertices[index, side, :count])
            for side, count in enumerate(self._draws.counts[index])
        )
        return left, right


@kernel
def between(low: float, high: float, fraction: float) -> float:
    """Map a number in [0, 1) as ``Generator.uniform(low, high)`` does."""
    return low + (high - low) * fraction


@kernel
def build_obstacles(  # noqa: PLR0913 - kernels take numbers
    grid_size: int,
    extent: float,
    noise: float,
    draws: Draws,
    scenarios: Scenarios,
    blocked: NDArray[np.bool_],
) -> None:
    """Make scenarios from random numbers, and mark those whose start is not free of walls."""
    quads = np.empty((MAX_QUADS, 4, 2))
    for i in range(len(blocked)):
        record: ScenarioRecord = scenarios.scenarios[i]
        noise_x = between(-noise * extent, noise * extent, draws.places[i, 0])
        noise_y = between(-noise * extent, noise * extent, draws.places[i, 1])
        passage = between(-PASSAGE_RANGE * extent, PASSAGE_RANGE * extent, draws.places[i, 2])
        record.start_x = between(-FAR * extent, FAR * extent, draws.starts[i])
        record.start_y = START_Y * extent
        record.goal_x = COLUMNS[draws.regions[i]] * extent + noise_x
        record.goal_y = FAR * extent + noise_y
        record.target_x = np.nan
        record.target_y = np.nan
        for side in range(2):
            vertices = draws.vertices[i, side, : draws.counts[i, side]]
            sign = -1.0 if side == 0 else 1.0
            _place_ends(grid_size, extent, passage, sign, vertices)
            _fill_wall(grid_size, draws.noise[i, side], vertices)
        count = write_quads(extent, draws.counts[i], draws.vertices[i], quads)
        record.quad_count = prepare_walls(quads[:count], scenarios.quads[i])
        blocked[i] = is_blocked(record.start_x, record.start_y, grid_size, quads[:count])


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
def _fill_wall(grid_size: int, noise: NDArray[np.float64], vertices: NDArray[np.float64]) -> None:
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
        if i < count - FIXED_VERTICES:
            vertices[i, 0] += between(-reach, reach, noise[2 * i])
            vertices[i, 1] += between(-reach, reach, noise[2 * i + 1])


@kernel
def write_quads(
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
def is_blocked(x: float, y: float, grid_size: int, quads: NDArray[np.float64]) -> bool:
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
