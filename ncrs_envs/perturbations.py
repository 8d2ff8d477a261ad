"""What may happen to a robot in an episode: lost cells, dead wheels, noise, and time to regrow.

A ``Scenario`` holds these records, so that every simulator takes the same ones. Cells are chosen in
an order, and a fraction says how many of them: one record takes the same share of any body.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.body import BodyGrid, Cell
from ncrs_envs.errors import NCRSError

Place = tuple[int, int]
"""Row and column of a cell."""

ROUNDING = 1e-9
"""Excess of a product over a whole number that is rounding."""
MAX_SEED = 2**63 - 1
GROWTH_PER_STEP = 2
"""Number of growth steps of a repair that take one physics step."""


class PerturbationError(NCRSError, ValueError):
    """A perturbation that is malformed, or that does not fit the grid."""


@dataclass(frozen=True)
class CellChoice:
    """Cells to which something happens before a control step.

    Raises:
        PerturbationError: A field is malformed.
    """

    step: int
    """Number of control steps that are done before it; 0 is before the first action."""
    cells: tuple[Place, ...]
    """Cells ``(row, column)``, in order."""
    fraction: float | None = None
    """Fraction of all cells concerned, 0 to 1, rounded up to whole cells: only the first of
    ``cells`` that make it up are chosen. None chooses all of ``cells``."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "step", check_whole(self.step, "step"))
        object.__setattr__(self, "cells", _places(self.cells))
        if self.fraction is not None:
            object.__setattr__(self, "fraction", check_share(self.fraction, "fraction"))

    def check(self, grid_size: int) -> None:
        """Raise ``PerturbationError`` if a cell lies outside the grid."""
        for row, column in self.cells:
            if max(row, column) >= grid_size:
                raise PerturbationError(
                    f"cells must lie in a grid of {grid_size} x {grid_size}, rows and columns from "
                    f"0, got {(row, column)}."
                )

    def chosen(self, concerned: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Choose among the concerned cells of a grid; bool, ``(n, n)``, as is the result."""
        places = [place for place in self.cells if concerned[place]]
        if self.fraction is not None:
            places = places[: math.ceil(self.fraction * int(concerned.sum()) - ROUNDING)]
        chosen = np.zeros_like(concerned)
        for place in places:
            chosen[place] = True
        return chosen


@dataclass(frozen=True)
class Damage(CellChoice):
    """Cells that vanish, if they are occupied; the fraction is of all modules of the body."""

    def left(self, body: BodyGrid) -> BodyGrid:
        """Return what is left of a body, int8 ``(n, n)``, read-only.

        One module always stays: if all were chosen, the last one.
        """
        lost = self.chosen(body != Cell.EMPTY)
        if lost.any() and not (body[~lost] != Cell.EMPTY).any():
            lost[next(place for place in reversed(self.cells) if lost[place])] = False
        left = np.where(lost, np.int8(Cell.EMPTY), body).astype(np.int8)
        left.flags.writeable = False
        return left


@dataclass(frozen=True)
class WheelFailure(CellChoice):
    """Wheels whose gas stays 0 from a step on; they still roll, with their friction."""

    def failed(self, body: BodyGrid) -> NDArray[np.bool_]:
        """Mark the wheels of a body that fail, bool ``(n, n)``."""
        return self.chosen(body == Cell.WHEEL)


Choice = TypeVar("Choice", bound=CellChoice)


def mirrored(choice: Choice, grid_size: int) -> Choice:
    """Return the same choice with left and right exchanged."""
    cells = tuple((row, grid_size - 1 - column) for row, column in choice.cells)
    return replace(choice, cells=cells)


@dataclass(frozen=True)
class Noise:
    """Normal noise; the seed decides every value of it.

    Raises:
        PerturbationError: A field is malformed.
    """

    seed: int = 0
    sensor: float = 0.0
    """Standard deviation of the noise on what light and target sensors sense, which stays within 0
    and 1."""
    state: float = 0.0
    """Standard deviation of the noise on the automaton's hidden and input/output channels, added in
    every occupied cell after every step of control, within the limits of the states."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "seed", check_whole(self.seed, "seed"))
        for name in ("sensor", "state"):
            object.__setattr__(self, name, check_deviation(getattr(self, name), name))


@dataclass(frozen=True)
class Repair:
    """Time that the automaton gets to regrow the robot.

    It returns to growth for ``steps``: control flag 0, body and part channels as they stand, all
    others zero, the alive rule of growth. The read-out is the new body; control goes on, with
    states of zero in new cells. Meanwhile the robot rolls on without thrust, one physics step for
    every two steps of growth.

    Raises:
        PerturbationError: A field is malformed.
    """

    steps: int
    """Number of growth steps."""
    every: int = 0
    """Number of actions between two repairs; 0 for one repair at once after the damage."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "steps", check_whole(self.steps, "repair_steps"))
        object.__setattr__(self, "every", check_whole(self.every, "repair_every"))
        if not self.steps:
            raise PerturbationError("A repair needs at least 1 step of growth, got 0.")

    @property
    def duration(self) -> int:
        """Number of physics steps that a repair takes."""
        return -(-self.steps // GROWTH_PER_STEP)


def check_whole(value: Any, name: str) -> int:
    """Return a non-negative integer, or raise ``PerturbationError``."""
    is_whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not is_whole or not 0 <= value <= MAX_SEED:
        raise PerturbationError(f"{name} must be a non-negative integer, got {value!r}.")
    return int(value)


def check_share(value: Any, name: str) -> float:
    """Return a number in [0, 1] as a float, or raise ``PerturbationError``."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        raise PerturbationError(f"{name} must be a number from 0 to 1, got {value!r}.")
    if not 0.0 <= value <= 1.0:
        raise PerturbationError(f"{name} must lie in 0 to 1, got {value!r}.")
    return float(value)


def check_deviation(value: Any, name: str) -> float:
    """Return a non-negative finite number as a float, or raise ``PerturbationError``."""
    is_number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    if not is_number or not 0.0 <= value <= sys.float_info.max:
        raise PerturbationError(
            f"The standard deviation of {name} noise must be finite and not negative, got "
            f"{value!r}."
        )
    return float(value)


def _places(cells: Iterable[Any]) -> tuple[Place, ...]:
    try:
        pairs = [(row, column) for row, column in cells]
    except (TypeError, ValueError) as error:
        raise PerturbationError(f"cells must be pairs (row, column), got {cells!r:.80}.") from error
    places = tuple((check_whole(row, "row"), check_whole(col, "column")) for row, col in pairs)
    if len(set(places)) < len(places):
        raise PerturbationError(f"cells must not hold a cell twice, got {places!r:.80}.")
    return places
