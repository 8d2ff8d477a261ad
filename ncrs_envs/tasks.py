"""Tasks: required body parts, distance scores, and conditions of success.

Source: paper section 4 (tasks); the inverse-square score and CarryBall's success radius are those
of the published runs.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.body import (
    DEFAULT_GRID_SIZE,
    HULL_DENSITY,
    BodyError,
    BodyGrid,
    Cell,
    check_grid_size,
    parse_body,
)
from ncrs_envs.errors import NCRSError
from ncrs_envs.registry import Registry

if TYPE_CHECKING:
    from ncrs_envs.scenario import Scenario

DISTANCE_SCORES = ("exponential", "inverse_square")

RIGID, JOINTED = "rigid", "jointed"
CONSTRUCTIONS = (RIGID, JOINTED)
"""Constructions of a robot: one rigid body; or a hull with a body for each wheel, on a joint."""
HULL_DENSITIES = (0.01, 100.0)
"""Smallest and largest density of the hull."""

MAX_EPISODE_STEPS = 100
PARTIAL_CREDIT = 0.01
"""Fitness per correct part of a body that is not valid."""
REGIONS = 4
"""Number of regions of the light or ball; the episodes of an evaluation cycle over them."""


class TaskError(NCRSError, ValueError):
    """An unknown task, or a task setting outside its allowed values."""


def playfield(grid_size: int) -> float:
    """Compute half the side of the playfield, P: coordinates run from -P to P (60 for 5 x 5)."""
    return max(50.0, 5.0 * grid_size + 35.0)


def distance_score(distance: float, extent: float, kind: str = "exponential") -> float:
    """Score a distance in (0, 1]: ``exp(-d/P)`` or ``(d/P + 1)^-2``, with ``P = extent``."""
    if kind == "exponential":
        return math.exp(-distance / extent)
    return (distance / extent + 1.0) ** -2


def distance_scores(
    distances: NDArray[np.float64], extent: float, kind: str
) -> NDArray[np.float64]:
    """Score many distances, as ``distance_score`` does one but for rounding."""
    if kind == "exponential":
        return np.asarray(np.exp(-distances / extent))
    return np.asarray((distances / extent + 1.0) ** -2)


class EpisodeView(Protocol):
    """What a task's own reward and condition of success may read after a step."""

    @property
    def pose(self) -> tuple[float, float, float]:
        """Centre (x, y) of the robot in units, and its heading in radians."""

    @property
    def ball(self) -> tuple[float, float] | None:
        """Centre of the ball in units; None without a ball."""

    @property
    def scenario(self) -> Scenario:
        """Placements of the episode."""

    @property
    def distances(self) -> Sequence[float]:
        """Distances in units: robot to light; with a ball, robot to ball and ball to target."""

    @property
    def closest(self) -> Sequence[float]:
        """Minima of the distances over the steps so far."""


PlaceFunction = Callable[[np.random.Generator, int, int, float], "Scenario"]
"""Function of generator, region, grid size and noise that draws a scenario."""
RewardFunction = Callable[[EpisodeView], float]
SuccessFunction = Callable[[EpisodeView], bool]


@dataclass(frozen=True)
class Task:
    """Definition of one task.

    A task of one's own is made of the existing pieces (a light, or a ball with its target, and
    walls) with its own placements; on Box2D it may also have its own reward and condition of
    success. ``register_task`` makes it known by name.
    """

    name: str
    env_id: str
    success_radius: float
    """Default success radius in units: robot to light, or ball to target."""
    required_parts: tuple[tuple[Cell, int], ...]
    """Minimum number of each part that a body must have."""
    has_light: bool = False
    has_ball: bool = False
    has_walls: bool = False
    has_touch: bool = False
    """True if bodies may have touch sensors; needs walls, which they touch."""
    place: PlaceFunction | None = None
    """Function that draws a scenario; None for the placements of the paper."""
    reward: RewardFunction | None = None
    """Function of the episode after a step; None for the mean score of the distances."""
    succeeds: SuccessFunction | None = None
    """Function of the episode after a step; None for the last distance within the radius."""

    def __post_init__(self) -> None:
        if self.has_light == self.has_ball:
            raise TaskError(f"{self.name} must have either a light or a ball with its target.")
        if self.has_touch and (self.has_ball or not self.has_walls):
            raise TaskError(f"{self.name} needs a light and walls for its touch sensors.")

    @property
    def not_compiled(self) -> str | None:
        """What only Box2D can run of it, to follow the task's name; None if there is nothing."""
        if self.reward is not None or self.succeeds is not None:
            return "has its own reward or condition of success"
        if self.has_ball and self.has_walls:
            return "has a ball and walls, which touch each other"
        return None

    @property
    def title(self) -> str:
        """Name for display and in the names of classes: "LightChase" for "light_chase"."""
        return self.name.title().replace("_", "")

    def cell_label(self, cell: Cell) -> str:
        """Name a cell type for display; in a task with a ball, light sensors are ball sensors."""
        return "ball sensor" if self.has_ball and cell is Cell.LIGHT_SENSOR else cell.label

    @property
    def part_cells(self) -> tuple[Cell, ...]:
        """Cell types of this task's bodies, in the order of the NCA's channels."""
        if self.has_ball:
            return (Cell.TISSUE, Cell.LIGHT_SENSOR, Cell.TARGET_SENSOR, Cell.WHEEL)
        if self.has_touch:
            return (Cell.TISSUE, Cell.LIGHT_SENSOR, Cell.TOUCH_SENSOR, Cell.WHEEL)
        return (Cell.TISSUE, Cell.LIGHT_SENSOR, Cell.WHEEL)

    @property
    def distances(self) -> int:
        """Number of distances in the reward: to the light; or to the ball, and ball to target."""
        return 2 if self.has_ball else 1

    @property
    def min_sensors(self) -> int:
        """Minimum number of sensors of all types in a valid body."""
        return sum(n for cell, n in self.required_parts if cell is not Cell.WHEEL)

    def correct_parts(self, bodies: NDArray[Any]) -> NDArray[np.int64]:
        """Count the required parts present, each up to the number required.

        Args:
            bodies: Cell codes, shape ``(..., n, n)``.

        Returns:
            Number of parts, int64, shape ``(...)``.
        """
        counts = [
            np.minimum((bodies == cell).sum(axis=(-2, -1)), needed)
            for cell, needed in self.required_parts
        ]
        return np.asarray(sum(counts), dtype=np.int64)

    def is_valid(self, bodies: NDArray[Any]) -> NDArray[np.bool_]:
        """Return True for each valid body; shapes as in ``correct_parts``."""
        complete = self.correct_parts(bodies) == sum(needed for _, needed in self.required_parts)
        allowed = np.isin(bodies, [int(c) for c in (Cell.EMPTY, *self.part_cells)])
        return np.asarray(complete & allowed.all(axis=(-2, -1)))

    def partial_credit(self, bodies: NDArray[Any]) -> NDArray[np.float64]:
        """Compute the fitness of bodies that are not valid; shapes as in ``correct_parts``."""
        return self.correct_parts(bodies).astype(np.float64) * PARTIAL_CREDIT

    def check_body(self, body: BodyGrid) -> None:
        """Raise ``BodyError`` with the missing or foreign parts unless the body is valid."""
        lacking = []
        for cell, needed in self.required_parts:
            found = int((body == cell).sum())
            if found < needed:
                name = self.cell_label(cell)
                lacking.append(
                    f"{needed} {name}{'s' if needed > 1 else ''} (code {int(cell)}), has {found}"
                )
        if lacking:
            raise BodyError(
                f"A body for {self.name} needs at least " + "; and at least ".join(lacking) + "."
            )
        foreign = sorted(set(np.unique(body).tolist()) - {0, *map(int, self.part_cells)})
        if foreign:
            raise BodyError(
                f"A body for {self.name} cannot hold {Cell(foreign[0]).label} cells "
                f"(code {foreign[0]}, found {int((body == foreign[0]).sum())}); use codes "
                f"{[0, *map(int, self.part_cells)]}."
            )


_SEEKER_PARTS = ((Cell.LIGHT_SENSOR, 1), (Cell.WHEEL, 2))
_FEELER_PARTS = ((Cell.LIGHT_SENSOR, 1), (Cell.TOUCH_SENSOR, 1), (Cell.WHEEL, 2))
_CARRIER_PARTS = ((Cell.LIGHT_SENSOR, 1), (Cell.TARGET_SENSOR, 1), (Cell.WHEEL, 2))

LIGHT_CHASE = Task("light_chase", "NCRS-LightChase-v0", 20.0, _SEEKER_PARTS, has_light=True)
OBSTACLE = Task("obstacle", "NCRS-Obstacle-v0", 20.0, _SEEKER_PARTS, has_light=True, has_walls=True)
CARRY_BALL = Task("carry_ball", "NCRS-CarryBall-v0", 10.0, _CARRIER_PARTS, has_ball=True)
OBSTACLE_TOUCH = Task(
    "obstacle_touch",
    "NCRS-ObstacleTouch-v0",
    20.0,
    _FEELER_PARTS,
    has_light=True,
    has_walls=True,
    has_touch=True,
)
"""An extension of the paper's tasks."""

PAPER_TASKS = (LIGHT_CHASE, OBSTACLE, CARRY_BALL)
BUILT_IN = (*PAPER_TASKS, OBSTACLE_TOUCH)
TASKS: Registry[Task] = Registry("task", {task.name: task for task in BUILT_IN})
"""Every task by its name; those of extensions are found when a name is looked up."""


def get_task(task: str | Task) -> Task:
    """Return the task of that name, or the task itself.

    Raises:
        TaskError: The name is unknown.
    """
    if isinstance(task, Task):
        return task
    if not isinstance(task, str) or task not in TASKS:
        raise TaskError(f"Unknown task {task!r}; choose one of {sorted(TASKS)}.")
    return TASKS[task]


def default_body(task: Task, grid_size: int) -> BodyGrid:
    """Make a small four-wheeled body, valid for the task: 3 x 3 cells in the middle of the grid."""
    sensors = "LTL" if task.has_ball else "LCL" if task.has_touch else "L#L"
    rows = np.full((grid_size, grid_size), ".", dtype="<U1")
    corner = (grid_size - 3) // 2
    core = [list(row) for row in (sensors, "W#W", "W#W")]
    rows[corner : corner + 3, corner : corner + 3] = core
    return parse_body(["".join(row) for row in rows], grid_size)


def check_distance_score(kind: Any) -> str:
    """Return ``kind`` if it is a known distance score, else raise ``TaskError``."""
    if kind not in DISTANCE_SCORES:
        raise TaskError(f"distance_score must be one of {list(DISTANCE_SCORES)}, got {kind!r}.")
    return str(kind)


def check_success_radius(radius: Any, task: Task) -> float:
    """Return the success radius in units (the task's own for None), else raise ``TaskError``."""
    if radius is None:
        return task.success_radius
    if (
        isinstance(radius, bool)
        or not isinstance(radius, int | float | np.number)
        or not 0 < radius <= sys.float_info.max
    ):
        raise TaskError(f"success_radius must be a positive finite number, got {radius!r}.")
    return float(radius)


def check_construction(construction: Any) -> str:
    """Return ``construction`` if it is a known one, else raise ``TaskError``."""
    if construction not in CONSTRUCTIONS:
        raise TaskError(f"construction must be one of {list(CONSTRUCTIONS)}, got {construction!r}.")
    return str(construction)


def check_hull_density(density: Any) -> float:
    """Return the hull's density, else raise ``TaskError``."""
    lowest, highest = HULL_DENSITIES
    is_number = isinstance(density, int | float | np.number) and not isinstance(density, bool)
    if not is_number or not lowest <= density <= highest:
        raise TaskError(
            f"hull_density must be a number from {lowest:g} to {highest:g}, got {density!r}."
        )
    return float(density)


# Not frozen: OmegaConf makes frozen dataclasses read-only, so nothing could be overridden.
@dataclass
class TaskSettings:
    """A task with the settings that users may change, checked on creation.

    Raises:
        TaskError: The task, score or construction is unknown, or the success radius or the hull's
            density is out of range.
        BodyError: ``grid_size`` is not an integer of at least 3.
    """

    name: str = "light_chase"
    """"light_chase", "obstacle", "carry_ball", or the extension "obstacle_touch"."""
    grid_size: int = DEFAULT_GRID_SIZE
    """Side n of the body grid, at least 3."""
    distance_score: str = "exponential"
    """"exponential" or "inverse_square", the score of the paper's published CarryBall runs."""
    success_radius: float | None = None
    """Success radius in units; null for the task's own."""
    construction: str = RIGID
    """Construction of the robots: rigid, one rigid body; or, on Box2D alone, jointed, a hull and a
    body for each wheel on a locked joint, as in the published code."""
    hull_density: float = HULL_DENSITY
    """Density of all cells but the wheels, 0.01 to 100; on Box2D alone if it is not 1."""

    def __post_init__(self) -> None:
        self.grid_size = check_grid_size(self.grid_size)
        check_distance_score(self.distance_score)
        check_success_radius(self.success_radius, self.task)
        check_construction(self.construction)
        self.hull_density = check_hull_density(self.hull_density)

    @property
    def task(self) -> Task:
        """Task of these settings."""
        return get_task(self.name)

    @property
    def radius(self) -> float:
        """Success radius in units, the task's own by default."""
        return check_success_radius(self.success_radius, self.task)

    @property
    def needs_box2d(self) -> bool:
        """True if only Box2D can run the task with these settings."""
        return self.not_compiled is not None

    @property
    def not_compiled(self) -> str | None:
        """What only Box2D can run, to follow the task's name; None if there is nothing."""
        if self.construction != RIGID:
            return f"has construction={self.construction}"
        if self.hull_density != HULL_DENSITY:
            return f"has hull_density={self.hull_density:g}"
        return self.task.not_compiled
