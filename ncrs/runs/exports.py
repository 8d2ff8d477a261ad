"""Archives in other programs' formats: CSV, and pyribs."""

from __future__ import annotations

import csv
import gzip
import io
import pickle
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from ncrs.evolution.archive import Archive
from ncrs.runs.checkpoint import write_atomically
from ncrs.runs.elites import EliteArchive
from ncrs.runs.seeds import row_numbers
from ncrs_envs.body import body_to_characters
from ncrs_envs.errors import NCRSError

MEASURES = ("sensors", "wheels", "cells")
"""Names of an archive's measures, in its order."""
CSV_COLUMNS = (
    *MEASURES, "fitness", "success", "standing_still", "generation",
    "evaluation_seed", "body",
)  # fmt: skip

_CELLS_AT_ONCE = 1000


class ExportError(NCRSError, ValueError):
    """An export whose package is not installed, or axes that an archive does not have."""


def write_csv(elites: EliteArchive, path: Path) -> None:
    """Write one line per elite, without genomes; rows of a body are joined by "/".

    Raises:
        CheckpointError: If it could not be written.
    """
    archive = elites.archive
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(CSV_COLUMNS)
    columns = [archive.column(name) for name in ("fitness", "success", "standing_still")]
    generations, seeds, bodies = map(archive.column, ("generations", "seeds", "bodies"))
    for index, triple in enumerate(archive.measures.tolist()):
        seed = map(str, row_numbers(seeds[index]))
        body = body_to_characters(bodies[index]).replace("\n", "/")
        numbers = [repr(float(column[index])) for column in columns]
        writer.writerow([*triple, *numbers, int(generations[index]), " ".join(seed), body])
    write_atomically(path, lambda stream: stream.write(text.getvalue().encode()))


def to_pyribs(archive: Archive, axes: Sequence[str] = MEASURES) -> Any:
    """Make a ``ribs.archives.GridArchive`` of the elites, one grid cell for each whole number.

    Its extra fields are "generation", "success", "evaluation_seed" (padded with -1) and "body",
    whose n * n cell codes stand row by row, since pyribs' tables take no fields of more axes.

    Args:
        archive: The elites.
        axes: The measures that span the grid, of "sensors", "wheels" and "cells". Without all
            three, each grid cell holds the fittest of the elites that differ in the others, and
            these are extra fields too.

    Raises:
        ExportError: If pyribs is not installed, or an axis is unknown or named twice.
    """
    columns = _axis_columns(axes)
    try:
        from ribs.archives import GridArchive
    except ImportError as error:
        raise ExportError(
            "The export to pyribs needs the package ribs: pip install 'ncrs[qd]'."
        ) from error
    triples = archive.space.triples[:, columns]
    low, high = triples.min(axis=0), triples.max(axis=0)
    others = {
        name: archive.measures[:, column]
        for column, name in enumerate(MEASURES)
        if column not in columns
    }
    extra: dict[str, tuple[tuple[int, ...], Any]] = {
        "body": ((archive.grid_size**2,), np.int8),
        "generation": ((), np.int64),
        "success": ((), np.float64),
        "evaluation_seed": ((archive.column("seeds").shape[1],), np.int64),
        **dict.fromkeys(others, ((), np.int64)),
    }
    result = GridArchive(
        solution_dim=archive.dimension,
        dims=(high - low + 1).tolist(),
        # Cells reach half a unit to both sides of each whole number.
        ranges=list(zip((low - 0.5).tolist(), (high + 0.5).tolist(), strict=True)),
        solution_dtype=np.float32,
        objective_dtype=np.float64,
        measures_dtype=np.float64,
        seed=0,
        extra_fields=extra,
    )
    _clear(result, low, high, extra)
    if len(archive):
        result.add(
            archive.column("genomes"),
            archive.column("fitness"),
            archive.measures[:, columns].astype(np.float64),
            body=archive.column("bodies").reshape(len(archive), -1),
            generation=archive.column("generations"),
            success=archive.column("success"),
            evaluation_seed=archive.column("seeds"),
            **others,
        )
    return result


def _clear(
    grid: Any,
    low: NDArray[np.int64],
    high: NDArray[np.int64],
    extra: Mapping[str, tuple[tuple[int, ...], Any]],
) -> None:
    """Fill every cell of a grid with zeros, and empty it: pyribs leaves in them what was in memory.

    Args:
        grid: pyribs' archive, empty.
        low: Smallest measures.
        high: Largest measures.
        extra: Shape and dtype of the grid's own fields.
    """
    axes = [np.arange(first, last + 1.0) for first, last in zip(low, high, strict=True)]
    measures = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    for part in np.array_split(measures, len(measures) // _CELLS_AT_ONCE + 1):
        count = len(part)
        zeros = {name: np.zeros((count, *shape), dtype) for name, (shape, dtype) in extra.items()}
        grid.add(np.zeros((count, grid.solution_dim)), np.zeros(count), part, **zeros)
    grid.clear()


def write_pyribs(archive: Archive, path: Path, axes: Sequence[str] = MEASURES) -> None:
    """Write ``to_pyribs(archive, axes)`` as a pickle, compressed with gzip.

    Raises:
        ExportError: If pyribs is not installed, or an axis is unknown or named twice.
        CheckpointError: If it could not be written.
    """
    grid = to_pyribs(archive, axes)

    def write(stream: IO[bytes]) -> None:
        # Most of the grid is empty: of 5 x 5 cells' 220 MB, files keep a fifth or less.
        # Without the time of day: the same archive gives the same file.
        with gzip.GzipFile("", "wb", fileobj=stream, mtime=0) as compressed:
            pickle.dump(grid, compressed)

    write_atomically(path, write)


def _axis_columns(axes: Sequence[str]) -> list[int]:
    """Return the columns of the measures that the axes name."""
    unknown = [name for name in axes if name not in MEASURES]
    if not axes or unknown or len(set(axes)) < len(axes):
        raise ExportError(
            f"axes must be different measures among {', '.join(MEASURES)}, got {list(axes)}."
        )
    return [MEASURES.index(name) for name in axes]
