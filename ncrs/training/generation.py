"""One generation: its record and its curves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ncrs.automaton.device_genomes import AnyGenomes
from ncrs.engines.base import Evaluation
from ncrs.evolution.archive import AddResult, AddStatus


@dataclass(frozen=True)
class Generation:
    """P genomes with their results."""

    index: int
    """Index of the generation, from 0."""
    genomes: AnyGenomes
    """Genomes as evaluated, ``(P, N)``."""
    evaluation: Evaluation
    added: AddResult
    """Effect of the genomes on the archive."""

    def metrics(self, seconds: float) -> dict[str, float]:
        """Compute the values of its curves; NaN fitness is counted, not averaged.

        Args:
            seconds: Duration of the generation.
        """
        evaluation = self.evaluation
        fitness = evaluation.fitness[np.isfinite(evaluation.fitness)]
        best = int(np.nanargmax(evaluation.fitness))
        return {
            "fitness/best": float(fitness.max()),
            "fitness/mean": float(fitness.mean()),
            "fitness/median": float(np.median(fitness)),
            "fitness/std": float(fitness.std()),
            "fitness/nan": float(len(evaluation.fitness) - len(fitness)),
            "success/best": float(evaluation.success[best].mean()),
            "success/mean": float(evaluation.success.mean()),
            "population/valid": float(evaluation.valid.mean()),
            "population/cells_of_best": float(max(evaluation.measures[best, 2], 0)),
            "qd/new": float((self.added.status == AddStatus.NEW).sum()),
            "qd/improved": float((self.added.status == AddStatus.IMPROVED).sum()),
            "speed/evaluations_per_s": len(evaluation.fitness) / seconds,
            "speed/env_steps_per_s": evaluation.env_steps / seconds,
        }
