"""Counters of a run, and its result."""

from __future__ import annotations

import math
import signal
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from ncrs.engines.base import Evaluation
from ncrs.evolution.schema import check_like, check_names
from ncrs.runs.champion import Champion

_CURVE = "curve"


def _logged(curve: str, start: float) -> Any:
    """Declare a counter that is logged with every generation."""
    return field(default=start, metadata={_CURVE: curve})


@dataclass
class RunState:
    """Counters of a run; checkpoints and curves follow from the fields."""

    generation: int = 0
    """Number of generations done; index of the next one."""
    evaluations: int = _logged("progress/evaluations", 0)
    env_steps: int = _logged("progress/env_steps", 0)
    seconds: float = 0.0
    """Duration of the training until the last checkpoint, in seconds."""
    best_fitness: float = _logged("fitness/best_so_far", -math.inf)
    """Best fitness of any genome in any generation: a lucky draw, on its own scenarios."""
    dropped: int = _logged("qd/dropped", 0)
    """Number of elites that left the archive because their new estimate was NaN."""

    def count(self, evaluation: Evaluation) -> None:
        """Count one generation."""
        self.generation += 1
        self.evaluations += len(evaluation.fitness)
        self.env_steps += evaluation.env_steps
        self.best_fitness = max(self.best_fitness, float(np.nanmax(evaluation.fitness)))

    def metrics(self) -> dict[str, float]:
        """Return the values of the counters' curves."""
        return {
            item.metadata[_CURVE]: float(getattr(self, item.name))
            for item in fields(self)
            if _CURVE in item.metadata
        }

    def state(self) -> dict[str, Any]:
        """Return JSON values for a checkpoint."""
        return asdict(self)

    @classmethod
    def from_state(cls, state: Mapping[str, Any]) -> RunState:
        """Build the counters from their ``state``.

        Raises:
            StoredStateError: If a counter is missing, foreign or malformed.
        """
        reference = cls().state()
        check_names(state, reference, "The run's state", ())
        for name, value in state.items():
            check_like(value, reference[name], f"run.{name}", may_be_infinite=True)
        return cls(**state)


@dataclass(frozen=True)
class TrainingResult:
    """Result of a run."""

    run_dir: Path
    state: RunState
    champion: Champion | None
    """Best candidate for champion; None if none had a body that the task can use, or the run was
    stopped before the first choice."""
    filled: int
    """Number of measure triples that have an elite in the archive."""
    triples: int
    """Number of measure triples that bodies can have."""
    stopped_by: signal.Signals | None
    """Signal that ended the run early; None if it finished."""
