"""Counters of a run, and the record of how it ended."""

from __future__ import annotations

import math
import signal
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from ncrs.engines.base import Evaluation
from ncrs.runs.champion import Champion

_CURVE = "curve"


def _logged(curve: str, start: float) -> Any:
    """A counter that is logged with every generation."""
    return field(default=start, metadata={_CURVE: curve})


@dataclass
class RunState:
    """Counters of a run; checkpoints and curves follow from the fields."""

    generation: int = 0
    """Generations done."""
    evaluations: int = _logged("progress/evaluations", 0)
    env_steps: int = _logged("progress/env_steps", 0)
    seconds: float = 0.0
    """Duration of the training, until the last checkpoint."""
    best_fitness: float = _logged("fitness/best_so_far", -math.inf)
    """Best fitness of any genome in any generation: a lucky draw, on its own scenarios."""
    dropped: int = _logged("archive/dropped", 0)
    """Elites that left the archive because their new estimate was NaN."""

    def count(self, evaluation: Evaluation) -> None:
        """Count one generation."""
        self.generation += 1
        self.evaluations += len(evaluation.fitness)
        self.env_steps += evaluation.env_steps
        self.best_fitness = max(self.best_fitness, float(np.nanmax(evaluation.fitness)))

    def metrics(self) -> dict[str, float]:
        """Values of the counters' curves."""
        return {
            item.metadata[_CURVE]: float(getattr(self, item.name))
            for item in fields(self)
            if _CURVE in item.metadata
        }

    def state(self) -> dict[str, Any]:
        """JSON values, for checkpoints."""
        return asdict(self)

    @classmethod
    def from_state(cls, state: Mapping[str, Any]) -> RunState:
        """Inverse of ``state``."""
        return cls(**state)


@dataclass(frozen=True)
class TrainingResult:
    """The end of a run."""

    run_dir: Path
    state: RunState
    champion: Champion | None
    """The best re-evaluated genome; None if no candidate had a body that the task can use, or the
    run was stopped before the first round."""
    filled: int
    """Measure triples that have an elite in the archive."""
    triples: int
    """Measure triples that bodies can have."""
    stopped_by: signal.Signals | None
    """The signal that ended the run early; None if it finished."""
