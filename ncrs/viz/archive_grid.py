"""Archives as stacks of panels: sensors x wheels, one panel per number of cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class ArchiveGrid:
    """Values of measure triples, laid out for panels."""

    cells: NDArray[np.int64]
    """Number of cells of each panel, ascending, ``(panels,)``."""
    values: NDArray[np.float64]
    """Values, ``(panels, sensors, wheels)``, indexed by the counts; NaN without an elite."""
    possible: NDArray[np.bool_]
    """True where a body can have these measures; same shape."""


def archive_grid(
    measures: NDArray[np.integer], values: NDArray[np.floating], triples: NDArray[np.integer]
) -> ArchiveGrid:
    """Lay out values of elites.

    Args:
        measures: Sensors, wheels and cells of the elites, ``(E, 3)``.
        values: Value of each elite to show, ``(E,)``.
        triples: All possible measures, ``(K, 3)``.
    """
    cells = np.unique(triples[:, 2])
    shape = (len(cells), int(triples[:, 0].max()) + 1, int(triples[:, 1].max()) + 1)
    grid = np.full(shape, np.nan)
    possible = np.zeros(shape, dtype=np.bool_)
    possible[np.searchsorted(cells, triples[:, 2]), triples[:, 0], triples[:, 1]] = True
    grid[np.searchsorted(cells, measures[:, 2]), measures[:, 0], measures[:, 1]] = values
    return ArchiveGrid(cells, grid, possible)
