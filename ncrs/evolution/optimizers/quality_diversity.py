"""Base class and ranking of the optimizers that fill an archive."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ncrs.evolution.archive import NO_CELL, AddResult, Archive
from ncrs.evolution.optimizers.base import Fitness, Optimizer
from ncrs.evolution.optimizers.settings import OptimizerError

IntArray = NDArray[np.int64]


class QDOptimizer(Optimizer):
    """An optimizer that learns from the effect of its genomes on the attached archive."""

    candidate_source: ClassVar[str] = "elite"

    @property
    def _archive(self) -> Archive:
        if self._attached is None:
            raise OptimizerError(f"{self.name} needs an archive: call attach(archive) first.")
        return self._attached

    def tell(self, fitness: Fitness, added: AddResult | None = None) -> None:
        """Learn from the last population, see ``Optimizer.tell``; ``added`` is required."""
        missing = added is None or len(added.status) != len(np.atleast_1d(fitness))
        if missing and self._asked is not None:  # tell before ask is refused below
            given = None if added is None else f"{len(added.status)} genomes"
            raise OptimizerError(
                f"{self.name} needs the result of Archive.add for the {np.size(fitness)} genomes "
                f"told, got {given}."
            )
        super().tell(fitness, added)

    @property
    def mean(self) -> NDArray[np.float64]:
        """Genome of the archive's best elite, ``(N,)``; zeros while the archive is empty."""
        best = self._archive.best_genome()
        return np.zeros(self.dimension) if best is None else best


def ranks(stage: IntArray, value: Fitness) -> Fitness:
    """Rank genomes by two keys, float64 ``(P,)``, larger is better.

    Args:
        stage: First key, ``(P,)``, larger is better.
        value: Second key, which decides within a stage, ``(P,)``, larger is better.
    """
    result = np.empty(len(stage))
    result[np.lexsort((value, stage))] = np.arange(len(stage))
    return result


def without_cell_worst(
    stage: IntArray, value: Fitness, fitness: Fitness, added: AddResult
) -> Fitness:
    """Rank as ``ranks`` does, with genomes that have no cell below all others, by their fitness.

    Invalid bodies earn partial credit, which leads a search that starts among them to valid ones.
    """
    placed = added.cells != NO_CELL
    below_all = int(stage.min()) - 1
    return ranks(np.where(placed, stage, below_all), np.where(placed, value, fitness))
