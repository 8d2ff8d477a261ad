"""A run's curves as a table: ``metrics.csv``, one row per generation."""

from __future__ import annotations

import csv
import io
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ncrs.runs.checkpoint import write_atomically
from ncrs.runs.engine_settings import ConfigError

METRICS_FILE = "metrics.csv"
GENERATION = "generation"


class MetricsWarning(UserWarning):
    """A run's table of curves that lost rows; the run itself is whole."""


def _rows(path: Path) -> tuple[list[str], list[list[str]]]:
    """Read the columns' names and the whole rows: a killed run may have left half a row."""
    if not path.is_file():
        return [], []
    # A foreign byte spoils its own row, not the table.
    text = path.read_text(encoding="utf-8", errors="replace")
    rows = list(csv.reader(text[: text.rfind("\n") + 1].splitlines()))
    if not rows:
        return [], []
    return rows[0], [row for row in rows[1:] if len(row) == len(rows[0])]


class MetricsFile:
    """Appends a row per generation, and a column when a new metric appears.

    Args:
        folder: The run's folder.
        start: Index of the first generation to come; when a run is resumed, its rows from there on
            are dropped.
    """

    def __init__(self, folder: Path, start: int) -> None:
        self._path = folder / METRICS_FILE
        names, rows = _rows(self._path)
        if names[:1] != [GENERATION]:
            rows = []  # the names are lost, and with them the meaning of the values
        sound = {int(row[0]): row for row in rows if row[0].isdigit() and _are_numbers(row)}
        kept = [row for generation, row in sorted(sound.items()) if generation < start]
        if len(kept) < start:
            warnings.warn(
                f"{self._path} lacks {start - len(kept)} of the {start} generations done so far, "
                "or they are damaged: its curves have gaps. The run itself is whole.",
                MetricsWarning,
                stacklevel=2,
            )
        self._names = names
        self._write(names if kept else [], kept)

    def _write(self, names: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        self._names = list(names) or [GENERATION]
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self._names)
        writer.writerows([*row, *[""] * (len(self._names) - len(row))] for row in rows)
        write_atomically(self._path, lambda stream: stream.write(text.getvalue().encode()))

    def add(self, generation: int, metrics: Mapping[str, float]) -> None:
        """Append one generation's values."""
        new = [name for name in metrics if name not in self._names]
        if new:
            self._write([*self._names, *new], _rows(self._path)[1])
        values = [str(generation), *(_text(metrics.get(name)) for name in self._names[1:])]
        with self._path.open("a", encoding="utf-8") as stream:
            stream.write(",".join(values) + "\n")


def _are_numbers(cells: Sequence[str]) -> bool:
    try:
        [float(cell or "nan") for cell in cells]
    except ValueError:
        return False
    return True


def _text(value: float | None) -> str:
    return "" if value is None else repr(float(value))


def read_metrics(run_dir: Path) -> dict[str, NDArray[np.float64]]:
    """Read the columns of a run's table, each ``(generations,)``; NaN where a value is missing.

    Raises:
        ConfigError: If the run has no table, or one that is damaged.
    """
    path = run_dir / METRICS_FILE
    names, rows = _rows(path)
    if not rows or names[0] != GENERATION:
        raise ConfigError(
            f"{path} holds no generation: the run has not finished one; let it train for longer."
        )
    try:
        table = np.array([[float(value or "nan") for value in row] for row in rows])
    except ValueError as error:
        raise ConfigError(f"{path} is not a table of numbers: {error}.") from error
    return dict(zip(names, table.T, strict=True))
