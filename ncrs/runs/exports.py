"""Archives in other programs' formats: CSV, and pyribs."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

import numpy as np

from ncrs.evolution.archive import Archive
from ncrs.runs.checkpoint import write_atomically
from ncrs.runs.elites import EliteArchive
from ncrs.runs.seeds import row_numbers
from ncrs_envs.body import body_to_characters
from ncrs_envs.errors import NCRSError

CSV_COLUMNS = (
    "sensors", "wheels", "cells", "fitness", "success", "standing_still", "generation",
    "evaluation_seed", "body",
)  # fmt: skip


class ExportError(NCRSError, ValueError):
    """An export whose package is not installed."""


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


def to_pyribs(archive: Archive) -> Any:
    """Make a ``ribs.archives.GridArchive`` of the elites, one grid cell per measure triple.

    Its measures are sensors, wheels and cells; its extra fields are "body", "generation", "success"
    and "evaluation_seed" (padded with -1).

    Raises:
        ExportError: If pyribs is not installed.
    """
    try:
        from ribs.archives import GridArchive
    except ImportError as error:
        raise ExportError(
            "The export to pyribs needs the package ribs: pip install 'ncrs[qd]'."
        ) from error
    low, high = archive.space.triples.min(axis=0), archive.space.triples.max(axis=0)
    grid = archive.grid_size
    result = GridArchive(
        solution_dim=archive.dimension,
        dims=(high - low + 1).tolist(),
        # Cells reach half a unit to both sides of each whole number.
        ranges=list(zip((low - 0.5).tolist(), (high + 0.5).tolist(), strict=True)),
        solution_dtype=np.float32,
        objective_dtype=np.float64,
        measures_dtype=np.float64,
        extra_fields={
            "body": ((grid, grid), np.int8),
            "generation": ((), np.int64),
            "success": ((), np.float64),
            "evaluation_seed": ((archive.column("seeds").shape[1],), np.int64),
        },
    )
    if len(archive):
        result.add(
            archive.column("genomes"),
            archive.column("fitness"),
            archive.measures.astype(np.float64),
            body=archive.column("bodies"),
            generation=archive.column("generations"),
            success=archive.column("success"),
            evaluation_seed=archive.column("seeds"),
        )
    return result
