"""A run's curves by generation: from its table of metrics, or from its TensorBoard files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ncrs.runs.metrics import GENERATION, METRICS_FILE, read_metrics

EVENT_FILES = "events.out.tfevents.*"
MOST_POINTS = 400
"""Points of a curve that are drawn."""


@dataclass(frozen=True)
class Curve:
    """Values of one metric."""

    generations: NDArray[np.int64]
    """Ascending, ``(G,)``."""
    values: NDArray[np.float64]
    """Finite, ``(G,)``."""

    def thinned(self, most: int = MOST_POINTS) -> Curve:
        """At most ``most`` points, evenly spaced, the first and the last among them."""
        if len(self.values) <= most:
            return self
        kept = np.linspace(0, len(self.values) - 1, most).round().astype(int)
        return Curve(self.generations[kept], self.values[kept])


def load_curves(run_dir: Path) -> dict[str, Curve]:
    """All scalar curves of a run by TensorBoard's tags; none if nothing was logged.

    Raises:
        ConfigError: a table of metrics that cannot be read.
    """
    if (run_dir / METRICS_FILE).is_file():
        table = read_metrics(run_dir)
        generations = table.pop(GENERATION).astype(int).tolist()
        return {
            tag: _curve(dict(zip(generations, values.tolist(), strict=True)))
            for tag, values in table.items()
        }
    if any(run_dir.glob(EVENT_FILES)):
        return _from_events(run_dir)
    return {}


def _curve(points: Mapping[int, float]) -> Curve:
    """Points by generation, whose values may be NaN; of a generation done twice the last counts."""
    kept = sorted((generation, value) for generation, value in points.items() if np.isfinite(value))
    return Curve(
        np.array([generation for generation, _ in kept], dtype=np.int64),
        np.array([value for _, value in kept], dtype=np.float64),
    )


def _from_events(run_dir: Path) -> dict[str, Curve]:
    from tensorboard.backend.event_processing import event_accumulator as events

    # 0 keeps all; of what is not a number, the minimum is to keep one.
    sizes = dict.fromkeys(events.DEFAULT_SIZE_GUIDANCE, 1) | {events.SCALARS: 0}
    accumulator = events.EventAccumulator(str(run_dir), size_guidance=sizes)
    accumulator.Reload()
    return {
        tag: _curve({event.step: event.value for event in accumulator.Scalars(tag)})
        for tag in accumulator.Tags()["scalars"]
    }
