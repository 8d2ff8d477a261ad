"""A run's curves by generation, from its table of metrics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ncrs.runs.metrics import GENERATION, METRICS_FILE, read_metrics

MAX_POINTS = 400
"""Maximum number of points that are drawn of a curve."""


@dataclass(frozen=True)
class Curve:
    """Values of one metric."""

    generations: NDArray[np.int64]
    """Generations, ascending, ``(G,)``."""
    values: NDArray[np.float64]
    """Values, finite, ``(G,)``."""

    def thinned(self, max_points: int = MAX_POINTS) -> Curve:
        """Keep at most ``max_points`` points, evenly spaced, with the first and the last."""
        if len(self.values) <= max_points:
            return self
        kept = np.linspace(0, len(self.values) - 1, max_points).round().astype(int)
        return Curve(self.generations[kept], self.values[kept])


def load_curves(run_dir: Path) -> dict[str, Curve]:
    """Load all curves of a run by TensorBoard's tags; none if nothing was logged.

    Raises:
        ConfigError: If the table of metrics cannot be read.
    """
    if not (run_dir / METRICS_FILE).is_file():
        return {}
    table = read_metrics(run_dir)
    generations = table.pop(GENERATION).astype(int).tolist()
    return {
        tag: _curve(dict(zip(generations, values.tolist(), strict=True)))
        for tag, values in table.items()
    }


def _curve(points: Mapping[int, float]) -> Curve:
    """Make a curve of the values by generation that are finite."""
    kept = sorted((generation, value) for generation, value in points.items() if np.isfinite(value))
    return Curve(
        np.array([generation for generation, _ in kept], dtype=np.int64),
        np.array([value for _, value in kept], dtype=np.float64),
    )
