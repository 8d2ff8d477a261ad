"""Robot bodies: the cell encoding, parsing of user input, and mass properties.

Source: paper section 4 (bodies); the densities are those of the published runs.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.errors import NCRSError

BodyGrid = NDArray[np.int8]


class Cell(IntEnum):
    """Content of one grid cell of a body."""

    EMPTY = 0
    TISSUE = 1
    LIGHT_SENSOR = 2
    """Senses the light, or the ball in CarryBall."""
    TARGET_SENSOR = 3
    """Senses the target area (CarryBall only)."""
    WHEEL = 4
    TOUCH_SENSOR = 5
    """Senses the walls that it touches (ObstacleTouch only)."""

    @property
    def label(self) -> str:
        """Name for display, such as "light sensor"; see also ``Task.cell_label``."""
        return self.name.lower().replace("_", " ")


CELL_SIZE = 2.0
"""Side of a cell, in length units."""

MIN_GRID_SIZE = 3
DEFAULT_GRID_SIZE = 5

HULL_DENSITY = 1.0
"""Default density of the hull, which is all cells but the wheels."""
CELL_DENSITY: Mapping[Cell, float] = {
    Cell.EMPTY: 0.0,
    Cell.TISSUE: HULL_DENSITY,
    Cell.LIGHT_SENSOR: HULL_DENSITY,
    Cell.TARGET_SENSOR: HULL_DENSITY,
    Cell.WHEEL: 0.1,
    Cell.TOUCH_SENSOR: HULL_DENSITY,
}
"""Mass per unit of area."""

CELL_CHARACTERS: Mapping[str, Cell] = {
    ".": Cell.EMPTY,
    "#": Cell.TISSUE,
    "L": Cell.LIGHT_SENSOR,
    "T": Cell.TARGET_SENSOR,
    "W": Cell.WHEEL,
    "C": Cell.TOUCH_SENSOR,
}
"""Characters in which a body can be written, one string per row."""

SENSOR_CELLS = (Cell.LIGHT_SENSOR, Cell.TARGET_SENSOR, Cell.TOUCH_SENSOR)


class BodyError(NCRSError, ValueError):
    """A body grid that is malformed, or that a task cannot use."""


def check_grid_size(grid_size: Any) -> int:
    """Return ``grid_size`` as an int.

    Raises:
        BodyError: ``grid_size`` is not an integer of at least 3.
    """
    if isinstance(grid_size, bool) or not isinstance(grid_size, int | np.integer):
        raise BodyError(
            f"grid_size must be an integer of at least {MIN_GRID_SIZE}, got {grid_size!r} "
            f"({type(grid_size).__name__})."
        )
    if grid_size < MIN_GRID_SIZE:
        raise BodyError(f"grid_size must be at least {MIN_GRID_SIZE}, got {grid_size}.")
    return int(grid_size)


def parse_body(body: Any, grid_size: int | None = None) -> BodyGrid:
    """Convert user input to a body grid.

    Args:
        body: Integer array or nested list of ``Cell`` codes, shape ``(n, n)``, or ``n`` rows of
            characters (``.`` empty, ``#`` tissue, ``L`` light sensor, ``T`` target sensor,
            ``W`` wheel, ``C`` touch sensor), as a sequence of strings or one string with rows that
            end with a line break or ``/``. Spaces between characters do not count.
        grid_size: Required side ``n`` of the grid; None for any ``n >= 3``.

    Returns:
        A new, read-only int8 array of shape ``(n, n)``; row 0 is the front of the robot.

    Raises:
        BodyError: ``body`` has the wrong rank, size or dtype, or an unknown code or character.
    """
    if isinstance(body, np.ndarray) and body.dtype.kind == "U":
        body = body.tolist()
    if isinstance(body, str):
        body = _split_rows(body)
    if isinstance(body, Sequence) and len(body) > 0 and all(isinstance(r, str) for r in body):
        body = _from_characters(body)
    try:
        grid = np.asarray(body)
    except ValueError as error:
        raise BodyError(
            f"body must be a square grid; its rows differ in length ({error})."
        ) from error
    if grid.dtype == object or not np.issubdtype(grid.dtype, np.integer):
        raise BodyError(
            f"body must hold integer cell codes 0 to {max(Cell)}, got dtype {grid.dtype}; "
            "convert it, for example with body.astype(np.int8), or write it as rows of characters."
        )
    if grid.ndim != 2:
        raise BodyError(
            f"body must have 2 axes (rows, columns), got {grid.ndim} with shape {grid.shape}."
        )
    if grid.shape[0] != grid.shape[1] or grid.shape[0] < MIN_GRID_SIZE:
        raise BodyError(
            f"body must be a square grid of at least {MIN_GRID_SIZE} x {MIN_GRID_SIZE}, "
            f"got {grid.shape[0]} x {grid.shape[1]}; pad it with 0 (empty)."
        )
    if grid_size is not None and grid.shape[0] != grid_size:
        raise BodyError(
            f"body must be {grid_size} x {grid_size}, got {grid.shape[0]} x {grid.shape[1]}; "
            "pad it with 0 (empty), or make the environment with another grid_size."
        )
    unknown = np.setdiff1d(grid, [int(cell) for cell in Cell])
    if unknown.size:
        raise BodyError(
            f"body holds unknown cell codes {unknown.tolist()}; known are "
            + ", ".join(f"{int(cell)} ({cell.name.lower()})" for cell in Cell)
            + "."
        )
    parsed = grid.astype(np.int8)
    parsed.setflags(write=False)
    return parsed


_ROW_ENDS = re.compile(r"\n|/|\\n")
"""Ends of rows in a string: a line break, as it is or as JSON shows it, or a slash."""


def is_whole_body(text: str) -> bool:
    """Tell a string of several rows from a single row."""
    return _ROW_ENDS.search(text.strip()) is not None


def _split_rows(text: str) -> list[str]:
    """Split a body in one string into its rows; without any end of a row, at the spaces."""
    rows = [row for row in _ROW_ENDS.split(text) if row.strip()]
    if not rows:
        raise BodyError(
            "body must have rows of characters, such as 'L#L/W#W/W#W', got an empty string."
        )
    return rows if len(rows) > 1 else text.split()


def _from_characters(rows: Sequence[str]) -> list[list[int]]:
    rows = ["".join(row.split()) for row in rows]
    unknown = sorted(set("".join(rows)) - set(CELL_CHARACTERS))
    if unknown:
        known = ", ".join(f"{c!r} {cell.name.lower()}" for c, cell in CELL_CHARACTERS.items())
        raise BodyError(f"body holds unknown characters {unknown}; known are {known}.")
    lengths = [len(row) for row in rows]
    if len(set(lengths)) > 1:
        raise BodyError(
            f"body must be a square grid; its rows differ in length: {lengths}. Write an empty "
            "cell as '.', since spaces do not count."
        )
    return [[int(CELL_CHARACTERS[c]) for c in row] for row in rows]


def body_to_characters(body: BodyGrid) -> str:
    """Write a body as lines of characters, row 0 (the front) first; inverse of ``parse_body``."""
    characters = {int(cell): c for c, cell in CELL_CHARACTERS.items()}
    return "\n".join("".join(characters[int(code)] for code in row) for row in body)


def sensor_mask(bodies: NDArray[Any]) -> NDArray[np.bool_]:
    """Mark sensor cells of every kind.

    Args:
        bodies: Cell codes, any shape.

    Returns:
        True in sensor cells; bool, same shape.
    """
    light_or_target = (bodies == Cell.LIGHT_SENSOR) | (bodies == Cell.TARGET_SENSOR)
    return np.asarray(light_or_target | (bodies == Cell.TOUCH_SENSOR))


def wheel_mask(bodies: NDArray[Any]) -> NDArray[np.bool_]:
    """Mark wheel cells.

    Args:
        bodies: Cell codes, any shape.

    Returns:
        True in wheel cells; bool, same shape.
    """
    return np.asarray(bodies == Cell.WHEEL)


def body_measures(bodies: NDArray[Any]) -> NDArray[np.int64]:
    """Count sensors, wheels and cells, the coordinates of the archive.

    Args:
        bodies: Cell codes, shape ``(..., n, n)``.

    Returns:
        Sensors of all types, wheels, occupied cells; int64, shape ``(..., 3)``.
    """
    counts = [sensor_mask(bodies), wheel_mask(bodies), np.asarray(bodies != Cell.EMPTY)]
    return np.stack([mask.sum(axis=(-2, -1), dtype=np.int64) for mask in counts], axis=-1)


def cell_centers(grid_size: int) -> NDArray[np.float64]:
    """Compute cell centres, shape ``(n, n, 2)``: x to the right, y forward (row 0), body frame."""
    offsets = (np.arange(grid_size) - (grid_size - 1) / 2) * CELL_SIZE
    centers = np.empty((grid_size, grid_size, 2))
    centers[..., 0] = offsets[None, :]
    centers[..., 1] = -offsets[:, None]
    return centers


@dataclass(frozen=True)
class MassProperties:
    """Mass, centre of mass (body frame, x and y) and moment of inertia about that centre."""

    mass: float
    center: tuple[float, float]
    inertia: float


def cell_densities(hull_density: float = HULL_DENSITY) -> NDArray[np.float64]:
    """Return the density of each cell code, with another one for the hull."""
    factor = hull_density / HULL_DENSITY
    return np.array([CELL_DENSITY[c] * (1.0 if c is Cell.WHEEL else factor) for c in Cell])


def mass_properties(body: BodyGrid, hull_density: float = HULL_DENSITY) -> MassProperties:
    """Compute the mass properties of the rigid body that all occupied cells form.

    Each cell is a solid square: mass ``density * side^2`` and inertia ``mass * side^2 / 6`` about
    its own centre, moved to the common centre by the parallel-axis theorem.

    Raises:
        BodyError: All cells are empty.
    """
    density = cell_densities(hull_density)
    masses = density[body] * CELL_SIZE**2
    mass = float(masses.sum())
    if mass == 0.0:
        raise BodyError("body has no cells, so it has no mass; at least one cell must not be 0.")
    centers = cell_centers(body.shape[0])
    center = (masses[..., None] * centers).sum(axis=(0, 1)) / mass
    squared = ((centers - center) ** 2).sum(axis=-1)
    inertia = float((masses * (CELL_SIZE**2 / 6.0 + squared)).sum())
    return MassProperties(mass, (float(center[0]), float(center[1])), inertia)
