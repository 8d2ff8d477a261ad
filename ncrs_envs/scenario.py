"""Placements of robot, light, ball, target and walls in one episode.

Everything random about an episode is drawn once, from one Generator, into a ``Scenario``. Every
simulator takes the same object, which makes common random numbers, replay and parity tests
possible. Source: paper section 4; the obstacle generator follows the published runs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.body import CELL_SIZE, DEFAULT_GRID_SIZE, check_grid_size
from ncrs_envs.errors import NCRSError
from ncrs_envs.overlaps import square_overlaps, wall_reach
from ncrs_envs.perturbations import Damage, Noise, Repair, WheelFailure
from ncrs_envs.physics import BALL_RADIUS, LIGHT_RADIUS
from ncrs_envs.tasks import REGIONS, Task, get_task, playfield

Point = tuple[float, float]
Polyline = tuple[Point, ...]

# Placements as fractions of the playfield extent P.
FAR = 0.6
NEAR = 0.3
NOISE = 0.05
MAX_NOISE = 0.35
"""Up to this noise, on 5 x 5 cells, no robot is near enough to a light to succeed at the start."""
START_Y = -0.85
CORNER_REGIONS = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
COLUMN_REGIONS = (-FAR, -NEAR, NEAR, FAR)
WALL_EXTENT = 1.1
"""Outer extent of the walls: they begin at y = -1.1 P and extend to x = -1.1 P and 1.1 P."""
PASSAGE_RANGE = 0.8
WALL_REACH = 2.0
"""Maximum coordinates of a wall's points; those of sampled walls stay well below."""

# Wall shape in multiples of the grid size n.
PASSAGE_HALF_WIDTH = 0.7
WALL_TOP = 1.2
WALL_NOISE = 0.8
WALL_VERTICES = (5, 20)
"""Minimum number of vertices of a wall, and maximum plus one."""
MIN_QUAD_SIDE = 0.01
"""Minimum height and width in units of a wall quad that is simulated."""
MAX_START_DRAWS = 1000
"""Maximum number of draws of a start that is clear of the walls."""


_PERTURBATIONS = {"damage": Damage, "failure": WheelFailure, "noise": Noise, "repair": Repair}


class ScenarioError(NCRSError, ValueError):
    """A scenario that is malformed, or that does not fit the task or the playfield."""


@dataclass(frozen=True)
class Scenario:
    """Placements of one episode, in world coordinates ``(x, y)`` and length units.

    Make a variant with ``dataclasses.replace(scenario, light=(20.0, 30.0))``. Fields are validated:
    points must be pairs of finite numbers, and each wall needs at least two points.

    Raises:
        ScenarioError: A field is malformed.
    """

    start: Point
    """Centre of the robot at the start; it heads +y."""
    light: Point | None = None
    ball: Point | None = None
    target: Point | None = None
    walls: tuple[Polyline, Polyline] | None = None
    """Inner edges of the left and the right wall, from bottom to top. Everything to the left of the
    first and to the right of the second, out to x = -1.1 P and 1.1 P, is solid."""
    damage: Damage | None = None
    failure: WheelFailure | None = None
    noise: Noise | None = None
    repair: Repair | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", _point(self.start, "start"))
        for name in ("light", "ball", "target"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, _point(value, name))
        if self.walls is not None:
            object.__setattr__(self, "walls", _walls(self.walls))
        for name, kind in _PERTURBATIONS.items():
            value = getattr(self, name)
            if not isinstance(value, kind | None):
                raise ScenarioError(f"{name} must be a {kind.__name__} or None, got {value!r:.80}.")

    @property
    def is_perturbed(self) -> bool:
        """True if anything happens to the robot: damage, failure, noise or repair."""
        return any(getattr(self, name) is not None for name in _PERTURBATIONS)

    def check(self, task: Task, grid_size: int) -> None:
        """Raise ``ScenarioError`` unless the scenario fits the task and its playfield."""
        extent = playfield(grid_size)
        needed = {
            "light": task.has_light,
            "ball": task.has_ball,
            "target": task.has_ball,
            "walls": task.has_walls,
        }
        for name, wanted in needed.items():
            given = getattr(self, name) is not None
            if given != wanted:
                raise ScenarioError(
                    f"A scenario for {task.name} must {'have' if wanted else 'not have'} {name}, "
                    f"got {name}={getattr(self, name)!r}."
                )
        for name in ("start", "light", "ball", "target"):
            point = getattr(self, name)
            if point is not None and max(abs(point[0]), abs(point[1])) > extent:
                raise ScenarioError(
                    f"{name} must lie in the playfield, -{extent:g} to {extent:g} on each axis "
                    f"for grid size {grid_size}, got {point}."
                )
        self._check_walls(WALL_REACH * extent)
        self._check_start(grid_size)
        for choice in (self.damage, self.failure):
            if choice is not None:
                choice.check(grid_size)

    def _check_walls(self, reach: float) -> None:
        for point in chain.from_iterable(self.walls or ()):
            if max(map(abs, point)) > reach:
                raise ScenarioError(
                    f"Points of walls must lie within -{reach:g} to {reach:g} on each axis, got "
                    f"{point}."
                )

    def _check_start(self, grid_size: int) -> None:
        """Refuse what overlaps the robot's grid at the start, where the simulators would differ."""
        half = grid_size * CELL_SIZE / 2.0
        for name, radius in (("light", LIGHT_RADIUS), ("ball", BALL_RADIUS)):
            point = getattr(self, name)
            if point is None:
                continue
            gaps = [max(0.0, abs(a - b) - half) for a, b in zip(point, self.start, strict=True)]
            if math.hypot(*gaps) < radius:
                raise ScenarioError(
                    f"The {name} at {point} overlaps the robot's grid at the start, a square of "
                    f"{2 * half:g} units around {self.start}; move one of them."
                )
        for sign, line in zip((1.0, -1.0), self.walls or (), strict=False):
            low, high = self.start[1] - half, self.start[1] + half
            if wall_reach(line, sign, low, high) > sign * self.start[0] - half:
                raise ScenarioError(
                    f"A wall overlaps the robot's grid at the start, a square of {2 * half:g} "
                    f"units around {self.start}; move one of them."
                )


def _point(value: Any, name: str) -> Point:
    try:
        x, y = value
        x, y = float(x), float(y)
    except (TypeError, ValueError) as error:
        raise ScenarioError(f"{name} must be a pair of numbers (x, y), got {value!r}.") from error
    if not (math.isfinite(x) and math.isfinite(y)):
        raise ScenarioError(f"{name} must be finite, got ({x}, {y}).")
    return (x, y)


def _walls(value: Any) -> tuple[Polyline, Polyline]:
    try:
        left, right = (
            tuple(_point(point, f"{side} wall point") for point in line)
            for side, line in zip(("left", "right"), value, strict=True)
        )
    except (TypeError, ValueError) as error:
        if isinstance(error, ScenarioError):
            raise
        raise ScenarioError(
            f"walls must be two lines of points, left and right, got {value!r}."
        ) from error
    if min(len(left), len(right)) < 2:
        raise ScenarioError(
            f"Each wall needs at least 2 points, got {len(left)} (left) and {len(right)} (right)."
        )
    return left, right


def wall_quads(scenario: Scenario, grid_size: int) -> NDArray[np.float64]:
    """Split the walls into convex quadrilaterals, shape ``(quads, 4, 2)``; 0 quads without walls.

    Each quad lies between two consecutive points of a wall and the points of the same heights at
    x = -+1.1 P, as in the published runs. Neighbouring quads may overlap where a wall folds back.
    """
    if scenario.walls is None:
        return np.empty((0, 4, 2))
    limit = WALL_EXTENT * playfield(grid_size)
    quads = []
    for line, outside in zip(scenario.walls, (-limit, limit), strict=True):
        inner = np.array(line)
        outer = inner.copy()
        outer[:, 0] = outside
        quads.append(np.stack([outer[:-1], inner[:-1], inner[1:], outer[1:]], axis=1))
    return np.concatenate(quads)


def sample_scenario(
    task: str | Task,
    rng: np.random.Generator,
    region: int | None = None,
    grid_size: int = DEFAULT_GRID_SIZE,
    noise: float = NOISE,
) -> Scenario:
    """Draw one scenario.

    Args:
        task: Task or its name.
        rng: Generator of all random numbers.
        region: Region of the light or ball, 0 to 3 in the order of the paper (corners
            counter-clockwise from the lower left, columns from left to right); None for a uniformly
            random one.
        grid_size: Side of the body grid, which scales the playfield and the walls.
        noise: Maximum distance of light or ball from the middle of the region on each axis, as a
            fraction of the playfield extent P, 0 to 0.35; 0.05 in the paper.

    Raises:
        ScenarioError: The region is unknown, or the noise is out of range.
        TaskError: The task is unknown.
    """
    task = get_task(task)
    extent = playfield(check_grid_size(grid_size))
    check_noise(noise)
    region = int(rng.integers(REGIONS)) if region is None else check_region(region)
    if task.place is not None:
        placed = task.place(rng, region, grid_size, noise)
        placed.check(task, grid_size)
        return placed
    noise_x, noise_y = rng.uniform(-noise * extent, noise * extent, size=2)
    if not (task.has_walls or task.has_ball):
        sign_x, sign_y = CORNER_REGIONS[region]
        light = (sign_x * FAR * extent + noise_x, sign_y * FAR * extent + noise_y)
        return Scenario(start=(0.0, 0.0), light=light)

    start_y = START_Y * extent
    column = COLUMN_REGIONS[region] * extent
    if task.has_ball:
        start = (rng.uniform(-FAR * extent, FAR * extent), start_y)
        target_x = COLUMN_REGIONS[int(rng.integers(REGIONS))] * extent
        return Scenario(
            start=start, ball=(column + noise_x, noise_y), target=(target_x, FAR * extent)
        )
    walls = _sample_walls(rng, grid_size)
    obstacle = Scenario(start=(0.0, start_y), walls=walls)
    quads = wall_quads(obstacle, grid_size)
    for _ in range(MAX_START_DRAWS):
        start = (rng.uniform(-FAR * extent, FAR * extent), start_y)
        if not square_overlaps(start, grid_size * CELL_SIZE / 2.0, quads):
            light = (column + noise_x, FAR * extent + noise_y)
            return Scenario(start=start, light=light, walls=walls)
    raise ScenarioError(  # pragma: no cover - the walls leave most of the start line free
        f"No start clear of the walls in {MAX_START_DRAWS} draws for grid size {grid_size}."
    )


def check_region(region: Any) -> int:
    """Return ``region`` as an int in [0, 4), else raise ``ScenarioError``."""
    if (
        isinstance(region, bool)
        or not isinstance(region, int | np.integer)
        or not 0 <= region < REGIONS
    ):
        raise ScenarioError(f"region must be an integer from 0 to {REGIONS - 1}, got {region!r}.")
    return int(region)


def check_noise(noise: Any) -> float:
    """Return ``noise`` as a float.

    Raises:
        ScenarioError: ``noise`` is not in [0, 0.35], which keeps light and ball in the playfield.
    """
    if (
        isinstance(noise, bool)
        or not isinstance(noise, int | float | np.number)
        or not 0.0 <= noise <= MAX_NOISE
    ):
        raise ScenarioError(
            f"The noise of the placements must lie in 0 to {MAX_NOISE}, got {noise!r}."
        )
    return float(noise)


def _sample_walls(rng: np.random.Generator, grid_size: int) -> tuple[Polyline, Polyline]:
    extent = playfield(grid_size)
    passage = rng.uniform(-PASSAGE_RANGE * extent, PASSAGE_RANGE * extent)
    lines = []
    for sign in (-1.0, 1.0):
        count = int(rng.integers(*WALL_VERTICES))
        bottom = (sign * WALL_EXTENT * extent, -WALL_EXTENT * extent)
        top = (passage + sign * PASSAGE_HALF_WIDTH * grid_size, WALL_TOP * grid_size)
        line = np.linspace(bottom, top, count)
        line[:-2] += rng.uniform(
            -WALL_NOISE * grid_size, WALL_NOISE * grid_size, size=(count - 2, 2)
        )
        lines.append(tuple((x, y) for x, y in line.tolist()))
    return lines[0], lines[1]


def sample_scenarios(
    task: str | Task,
    seed: int | Sequence[int] | np.random.SeedSequence,
    n: int = 12,
    grid_size: int = DEFAULT_GRID_SIZE,
    noise: float = NOISE,
) -> list[Scenario]:
    """Draw the scenarios of one evaluation: episode ``i`` has region ``i mod 4``.

    Args:
        task: Task or its name.
        seed: Seed for all scenarios; each episode has its own stream, so that the first episodes of
            a longer evaluation equal those of a shorter one.
        n: Number of episodes, at least 1.
        grid_size: Side of the body grid.
        noise: Noise of the placements, see ``sample_scenario``.

    Raises:
        ScenarioError: ``n`` is not a positive integer, or the noise is out of range.
        TaskError: The task is unknown.
    """
    return [
        sample_scenario(task, stream, region=i % REGIONS, grid_size=grid_size, noise=noise)
        for i, stream in enumerate(scenario_streams(seed, n))
    ]


def as_seed_sequence(
    seed: int | Sequence[int] | np.random.SeedSequence,
) -> np.random.SeedSequence:
    """Return a new seed sequence, which has no children yet.

    Raises:
        ScenarioError: ``seed`` is not a non-negative integer, a sequence of them, or a
            ``SeedSequence``.
    """
    # A SeedSequence counts the children it has spawned; a new one keeps its users pure.
    if isinstance(seed, np.random.SeedSequence):
        return np.random.SeedSequence(seed.entropy, spawn_key=seed.spawn_key)
    if seed is None or isinstance(seed, bool):  # numpy would draw another seed every time
        raise ScenarioError(f"seed must be a non-negative integer, got {seed!r}.")
    try:
        return np.random.SeedSequence(seed)
    except (TypeError, ValueError) as error:
        raise ScenarioError(
            f"seed must be a non-negative integer, or a sequence of them, got {seed!r}."
        ) from error


def scenario_streams(
    seed: int | Sequence[int] | np.random.SeedSequence, n: int, per_stream: int = 1
) -> list[np.random.Generator]:
    """Make generators from one seed for ``n`` episodes, each for ``per_stream`` of them.

    Raises:
        ScenarioError: ``n`` is not a positive integer.
    """
    if isinstance(n, bool) or not isinstance(n, int | np.integer) or n < 1:
        raise ScenarioError(f"n must be a positive integer number of episodes, got {n!r}.")
    children = as_seed_sequence(seed).spawn(-(-int(n) // per_stream))
    return [np.random.Generator(np.random.PCG64(child)) for child in children]
