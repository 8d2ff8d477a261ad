"""The archive of a quality-diversity search: the best genome of every measure triple.

Source: paper section 5. Nothing here knows tasks or environments, so that optimizers can use it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.device_genomes import DeviceGenomes
from ncrs_envs.errors import NCRSError

PAPER_TRIPLES = 2024
"""The paper divides by this in all tasks; it is the number of triples of CarryBall alone."""
SEED_LENGTH = 4
"""Number of integers that identify an elite's scenarios, see ``Archive.add``."""
NO_CELL = -1
NO_ROW = -1
_FIRST_ROOM = 64
STANDING_STILL_MARGIN = 0.01
"""An elite beats standing still if it earns at least this much more: a robot that merely creeps
gains less (0.01 is about 1.4 units nearer to LightChase's light, averaged over an episode)."""
SUCCESS_FRACTION = 0.5
"""An elite succeeds if at least this fraction of its episodes does."""


class ArchiveError(NCRSError, ValueError):
    """Values that an archive cannot hold, or a state of another archive."""


class AddStatus(IntEnum):
    """The effect of adding a genome."""

    NONE = 0
    IMPROVED = 1
    NEW = 2


@dataclass(frozen=True)
class AddResult:
    """The effect of adding P genomes, one after the other."""

    cells: NDArray[np.int64]
    """Cell of each genome, ``(P,)``; -1 for an invalid body or NaN fitness."""
    status: NDArray[np.int8]
    """``AddStatus`` of each, ``(P,)``."""
    improvement: NDArray[np.float64]
    """Fitness minus that of the elite found in the cell, or fitness itself if the cell was empty
    (Fontaine et al. 2020, algorithm 2); ``(P,)``, NaN without a cell."""


@dataclass(frozen=True)
class MeasureSpace:
    """All measure triples (sensors, wheels, cells) that bodies can have.

    Those with ``sensors >= min_sensors``, ``wheels >= min_wheels`` and
    ``sensors + wheels <= cells <= max_cells``: 2,300 for one sensor and two wheels on 5 x 5 cells,
    2,024 for two sensors.
    """

    min_sensors: int
    min_wheels: int
    max_cells: int

    @cached_property
    def triples(self) -> NDArray[np.int64]:
        """All triples in lexicographic order, ``(K, 3)``."""
        axis = np.arange(self.max_cells + 1)
        sensors, wheels, cells = np.meshgrid(axis, axis, axis, indexing="ij", sparse=True)
        enough = (sensors >= self.min_sensors) & (wheels >= self.min_wheels)
        return np.argwhere(enough & (sensors + wheels <= cells))

    @cached_property
    def _table(self) -> NDArray[np.int32]:
        table = np.full((self.max_cells + 1,) * 3, NO_CELL, dtype=np.int32)
        table[tuple(self.triples.T)] = np.arange(len(self.triples))
        return table

    def cells(self, measures: NDArray[np.integer]) -> NDArray[np.int64]:
        """Find each row of ``measures`` in ``triples``: its index, ``(P,)``; -1 if it has none."""
        inside = ((measures >= 0) & (measures <= self.max_cells)).all(axis=1)
        clipped = np.clip(measures, 0, self.max_cells)
        return np.where(inside, self._table[tuple(clipped.T)], NO_CELL).astype(np.int64)


class Archive:
    """One elite per measure triple, replaced by any better one.

    Args:
        space: The possible triples, K of them.
        dimension: Length N of a genome.
        grid_size: Side n of the bodies' grid.
    """

    def __init__(self, space: MeasureSpace, dimension: int, grid_size: int) -> None:
        self.space = space
        self.dimension = int(dimension)
        self.grid_size = int(grid_size)
        self._clear()

    def _clear(self) -> None:
        n = self.grid_size
        # Bodies of 15 x 15 cells have 1.9 million triples: only elites take memory.
        self._rows = np.full(len(self.space.triples), NO_ROW, dtype=np.int32)
        self._columns: dict[str, NDArray[Any]] = {
            "genomes": np.zeros((0, self.dimension), dtype=np.float32),
            "bodies": np.zeros((0, n, n), dtype=np.int8),
            "fitness": np.zeros(0),
            "success": np.zeros(0),
            "standing_still": np.zeros(0),
            "generations": np.zeros(0, dtype=np.int64),
            "seeds": np.zeros((0, SEED_LENGTH), dtype=np.int64),
        }
        self._cells = np.zeros(0, dtype=np.int64)

    def __len__(self) -> int:
        """Return the number of elites."""
        return len(self._cells)

    @property
    def cells(self) -> NDArray[np.int64]:
        """Indices of the filled cells in ascending order, ``(E,)``, a copy."""
        return self._cells.copy()

    def _occupied(self) -> NDArray[np.int32]:
        """Rows of the elites in the columns, in the order of ``cells``."""
        return self._rows[self._cells]

    def _fill(self, cells: NDArray[np.int64]) -> None:
        """Give rows to empty cells."""
        rows = np.arange(len(self), len(self) + len(cells))
        room = len(self._columns["fitness"])
        if len(cells) and rows[-1] >= room:
            more = max(rows[-1] + 1 - room, min(room, len(self._rows) - room), _FIRST_ROOM)
            for name, column in self._columns.items():
                empty = np.zeros((more, *column.shape[1:]), dtype=column.dtype)
                self._columns[name] = np.concatenate([column, empty])
        self._rows[cells] = rows
        self._cells = np.sort(np.concatenate([self._cells, cells]))

    def column(self, name: str) -> NDArray[Any]:
        """Copy one property of all elites, in the order of ``cells``.

        Args:
            name: Property: "genomes" float32 ``(E, N)``, "bodies" int8 ``(E, n, n)``, "fitness"
                float64, "success" float64 (fraction of episodes, 0 to 1), "standing_still" float64
                (fitness of standing still in the elite's scenarios), "generations" int64, or
                "seeds" int64 ``(E, 4)``. Those without a shape are ``(E,)``.
        """
        taken: NDArray[Any] = self._columns[name][self._occupied()]
        return taken

    @property
    def measures(self) -> NDArray[np.int64]:
        """Triples of the elites, ``(E, 3)``."""
        return self.space.triples[self._cells]

    def add(  # noqa: PLR0913 - the public call, keywords only
        self,
        genomes: NDArray[np.floating] | DeviceGenomes,
        fitness: NDArray[np.float64],
        measures: NDArray[np.integer],
        bodies: NDArray[np.int8],
        *,
        success: NDArray[np.float64] | float = 0.0,
        standing_still: NDArray[np.float64] | float = 0.0,
        generation: int = 0,
        seeds: NDArray[np.int64] | None = None,
    ) -> AddResult:
        """Offer genomes in order; each replaces the elite of its triple if its fitness is larger.

        Args:
            genomes: Genomes, ``(P, N)``, kept in float32; of those on a GPU only new elites are
                copied.
            fitness: Fitness of each, ``(P,)``; one with NaN never becomes an elite.
            measures: Measures of each, ``(P, 3)``; -1 for an invalid body, which never becomes an
                elite.
            bodies: Body of each, ``(P, n, n)``.
            success: Fraction of each genome's episodes that succeeded, ``(P,)`` or one for all.
            standing_still: Fitness of standing still in its scenarios, ``(P,)`` or one for all.
            generation: Index of the generation that evaluated them.
            seeds: Seed and keys of the scenarios' random stream, padded with -1, ``(P, 4)``,
                ``(1, 4)`` or ``(4,)``. None for zeros.

        Raises:
            ArchiveError: If a shape is wrong or a fitness infinite. Nothing is added then.
        """
        fitness = np.asarray(fitness, dtype=np.float64)
        count = len(fitness)
        self._check("genomes", genomes, (count, self.dimension))
        self._check("measures", measures, (count, 3))
        self._check("bodies", bodies, (count, self.grid_size, self.grid_size))
        _check_not_infinite(fitness)
        offered: dict[str, Any] = {
            "genomes": genomes if isinstance(genomes, DeviceGenomes) else np.asarray(genomes),
            "bodies": np.asarray(bodies),
            "fitness": fitness,
            "success": np.broadcast_to(success, count),
            "standing_still": np.broadcast_to(standing_still, count),
            "generations": np.broadcast_to(generation, count),
            "seeds": np.broadcast_to(0 if seeds is None else seeds, (count, SEED_LENGTH)),
        }
        cells = np.where(np.isnan(fitness), NO_CELL, self.space.cells(np.asarray(measures)))
        status = np.zeros(count, dtype=np.int8)
        improvement = np.full(count, np.nan)
        best = self._best(cells)
        elites: dict[int, int] = {}  # the last genome that takes a cell is the one to write
        for index, (cell, value) in enumerate(zip(cells.tolist(), fitness.tolist(), strict=True)):
            if cell == NO_CELL:
                continue
            before = best[cell]
            is_empty = math.isnan(before)
            improvement[index] = value if is_empty else value - before
            if is_empty or value > before:
                status[index] = AddStatus.NEW if is_empty else AddStatus.IMPROVED
                best[cell], elites[cell] = value, index
        written, taken = np.array(list(elites), dtype=np.int64), list(elites.values())
        kept = {name: values[taken] for name, values in offered.items()}  # may come from a GPU
        self._fill(written[self._rows[written] == NO_ROW])
        for name, column in self._columns.items():
            column[self._rows[written]] = kept[name]
        return AddResult(cells, status, improvement)

    def _best(self, cells: NDArray[np.int64]) -> dict[int, float]:
        """Fitness of the elite of each of ``cells``; NaN for an empty one."""
        asked = np.unique(cells[cells != NO_CELL])
        rows = self._rows[asked]
        best = np.full(len(asked), np.nan)
        best[rows != NO_ROW] = self._columns["fitness"][rows[rows != NO_ROW]]
        return dict(zip(asked.tolist(), best.tolist(), strict=True))

    def replace_estimates(
        self,
        fitness: NDArray[np.float64],
        success: NDArray[np.float64],
        standing_still: NDArray[np.float64] | float,
        seeds: NDArray[np.int64],
    ) -> None:
        """Give all elites new estimates, in the order of ``cells``; those with NaN are dropped.

        Args:
            fitness: Fitness of each elite, ``(E,)``.
            success: Fraction of its episodes that succeeded, ``(E,)``.
            standing_still: Fitness of standing still in its scenarios, ``(E,)`` or one for all.
            seeds: Seed and keys of the scenarios' random stream, ``(E, 4)`` or ``(4,)``.

        Raises:
            ArchiveError: If the number of values is wrong or a fitness infinite. Nothing is
                changed then.
        """
        count = len(self)
        self._check("fitness", fitness, (count,))
        self._check("success", success, (count,))
        if np.shape(seeds) != (SEED_LENGTH,):
            self._check("seeds", seeds, (count, SEED_LENGTH))
        if np.ndim(standing_still):
            self._check("standing_still", standing_still, (count,))
        _check_not_infinite(fitness)
        estimates = {"fitness": fitness, "success": success, "standing_still": standing_still}
        rows = self._occupied()
        for name, values in {**estimates, "seeds": seeds}.items():
            self._columns[name][rows] = values
        dropped = np.isnan(fitness)
        if dropped.any():
            kept = {name: self.column(name)[~dropped] for name in self._columns}
            self._put(self._cells[~dropped], kept)

    def _put(self, cells: NDArray[np.int64], elites: Mapping[str, NDArray[Any]]) -> None:
        """Hold these elites and no others; ``cells`` are ascending."""
        self._clear()
        self._fill(cells)
        for name, column in self._columns.items():
            column[self._rows[cells]] = elites[name]

    def draw(self, generator: np.random.Generator, count: int) -> NDArray[np.float64]:
        """Draw genomes of elites uniformly with replacement, float64 ``(count, N)``.

        Raises:
            ArchiveError: If the archive is empty.
        """
        if not len(self):
            raise ArchiveError("There is no elite to draw: the archive is empty.")
        drawn = self._occupied()[generator.integers(len(self), size=count)]
        return np.asarray(self._columns["genomes"][drawn], dtype=np.float64)

    def best_genome(self) -> NDArray[np.float64] | None:
        """Return the fittest elite's genome, float64 ``(N,)``; None if the archive is empty."""
        if not len(self):
            return None
        best = self._occupied()[int(np.argmax(self.column("fitness")))]
        return np.asarray(self._columns["genomes"][best], dtype=np.float64)

    def statistics(self) -> dict[str, float]:
        """Compute numbers for reports; best and mean are left out while the archive is empty.

        "filled_fraction" and "qd_score" (sum of the elites' fitness) are per possible triple. With
        "_of_2024" they are per triple of the paper, see ``PAPER_TRIPLES``. "beat_standing_still"
        and "succeed" count elites, see ``STANDING_STILL_MARGIN`` and ``SUCCESS_FRACTION``.
        """
        fitness = self.column("fitness")
        gain = fitness - self.column("standing_still")
        total = float(fitness.sum())
        possible = len(self.space.triples)
        statistics = {
            "filled": float(len(fitness)),
            "filled_fraction": len(fitness) / possible,
            "filled_fraction_of_2024": len(fitness) / PAPER_TRIPLES,
            "qd_score": total / possible,
            "qd_score_of_2024": total / PAPER_TRIPLES,
            "beat_standing_still": float((gain >= STANDING_STILL_MARGIN).sum()),
            "succeed": float((self.column("success") >= SUCCESS_FRACTION).sum()),
        }
        if len(fitness):
            statistics |= {"best": float(fitness.max()), "mean": float(fitness.mean())}
        return statistics

    def state(self) -> dict[str, Any]:
        """Return arrays and JSON values for a checkpoint, for filled cells only."""
        return {
            **self._identity,
            "cells": self.cells,
            "elites": {name: self.column(name) for name in self._columns},
        }

    def load_state(self, state: Mapping[str, Any]) -> None:
        """Restore the elites of a ``state``.

        Raises:
            ArchiveError: If the state is damaged, or has other measures, genomes or bodies.
                Nothing is changed then.
        """
        for key, value in self._identity.items():
            if state[key] != value:
                raise ArchiveError(
                    f"Cannot load the archive: its {key} is {state[key]!r}, expected {value!r}."
                )
        cells, elites = np.asarray(state["cells"]), state["elites"]
        ascending = cells.ndim == 1 and cells.dtype.kind == "i" and (np.diff(cells) > 0).all()
        possible = len(self.space.triples)
        if not ascending or (len(cells) and not 0 <= cells[0] <= cells[-1] < possible):
            raise ArchiveError(
                f"Cannot load the archive: its cells must be integers from 0 to {possible - 1} in "
                "ascending order."
            )
        for name, column in self._columns.items():
            self._check(name, elites[name], (len(cells), *column.shape[1:]))
        if not np.isfinite(elites["fitness"]).all():
            raise ArchiveError("Cannot load the archive: an elite's fitness is not finite.")
        self._put(cells.astype(np.int64), elites)

    @property
    def _identity(self) -> dict[str, Any]:
        return {
            "space": asdict(self.space),
            "dimension": self.dimension,
            "grid_size": self.grid_size,
        }

    @classmethod
    def from_state(cls, state: Mapping[str, Any]) -> Archive:
        """Build an archive from its ``state``; raises as ``load_state`` does."""
        archive = cls(MeasureSpace(**state["space"]), state["dimension"], state["grid_size"])
        archive.load_state(state)
        return archive

    @staticmethod
    def _check(name: str, value: Any, shape: tuple[int, ...]) -> None:
        if np.shape(value) != shape:
            raise ArchiveError(f"{name} must have shape {shape}, got {np.shape(value)}.")


def _check_not_infinite(fitness: NDArray[np.float64]) -> None:
    infinite = np.flatnonzero(np.isinf(fitness))
    if len(infinite):
        raise ArchiveError(
            f"Fitness must not be infinite; it is for genomes {infinite.tolist()}. The archive is "
            "unchanged."
        )
