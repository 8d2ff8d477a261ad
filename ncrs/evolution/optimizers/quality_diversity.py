"""The parts that the optimizers which fill an archive share."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ncrs.evolution.archive import NO_CELL, AddResult, Archive
from ncrs.evolution.optimizers.base import Fitness, Optimizer
from ncrs.evolution.optimizers.settings import OptimizerError

IntArray = NDArray[np.int64]


class QDOptimizer(Optimizer):
    """An optimizer that learns from what its genomes add to the archive it is attached to."""

    candidate_source: ClassVar[str] = "elite"

    @property
    def _archive(self) -> Archive:
        if self._attached is None:
            raise OptimizerError(f"{self.name} needs an archive: call attach(archive) first.")
        return self._attached

    def tell(self, fitness: Fitness, added: AddResult | None = None) -> None:
        """As every optimizer's; ``added`` is required."""
        missing = added is None or len(added.status) != len(np.atleast_1d(fitness))
        if missing and self._asked is not None:  # tell before ask is refused below
            given = None if added is None else f"{len(added.status)} genomes"
            raise OptimizerError(
                f"{self.name} needs what Archive.add returned for the {np.size(fitness)} genomes "
                f"told, got {given}."
            )
        super().tell(fitness, added)

    @property
    def mean(self) -> NDArray[np.float64]:
        """Genome of the archive's best elite, ``(N,)``; zeros while the archive is empty."""
        best = self._archive.best_genome()
        return np.zeros(self.dimension) if best is None else best


def ranks(stage: IntArray, value: Fitness) -> Fitness:
    """Rank of each genome, float64 ``(P,)``, larger is better.

    Args:
        stage: Key that decides first, ``(P,)``, larger is better.
        value: Key that decides within a stage, ``(P,)``.
    """
    result = np.empty(len(stage))
    result[np.lexsort((value, stage))] = np.arange(len(stage))
    return result


def without_cell_worst(
    stage: IntArray, value: Fitness, fitness: Fitness, added: AddResult
) -> Fitness:
    """``ranks`` with the genomes that have no cell below all others, by their own fitness.

    Invalid bodies earn partial credit, which leads a search that starts among them to valid ones.
    """
    placed = added.cells != NO_CELL
    lowest = int(stage.min()) - 1
    return ranks(np.where(placed, stage, lowest), np.where(placed, value, fitness))
