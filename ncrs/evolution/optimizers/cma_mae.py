"""CMA-MAE: CMA-ME with an archive whose thresholds rise slowly.

Source: Fontaine and Nikolaidis 2023, "Covariance Matrix Adaptation MAP-Annealing", algorithm 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs.evolution.archive import NO_CELL, AddResult, Archive
from ncrs.evolution.optimizers.base import Fitness, State
from ncrs.evolution.optimizers.emitters import EmitterOptimizer
from ncrs.evolution.optimizers.quality_diversity import without_cell_worst
from ncrs.evolution.optimizers.settings import CMAMAESettings
from ncrs.evolution.schema import check_like


class CMAMAE(EmitterOptimizer):
    """CMA-MAE from mean 0.

    Every cell has a threshold ``t``, at first ``threshold_min``. Genomes are ranked by
    ``fitness - t`` of their cell, and one that exceeds its threshold moves it to
    ``(1 - learning_rate) t + learning_rate fitness``. With learning rate 1 the thresholds are the
    elites' fitness, as in CMA-ME; with 0 this is CMA-ES on plain fitness.

    The source restarts an emitter when its CMA-ES converges, which noise prevents here; see
    ``patience`` instead. See ``EmitterOptimizer`` for the arguments.
    """

    settings: CMAMAESettings

    def __init__(
        self, dimension: int, seed: np.random.SeedSequence, settings: CMAMAESettings
    ) -> None:
        super().__init__(dimension, seed, settings)
        self._thresholds: NDArray[np.float64] = np.empty(0)

    def attach(self, archive: Archive) -> None:
        """Attach the run's archive, and reset all thresholds to ``threshold_min``."""
        super().attach(archive)
        self._thresholds = np.full(len(archive.space.triples), self.settings.threshold_min)

    @property
    def thresholds(self) -> NDArray[np.float64]:
        """Copy of the threshold of every cell, ``(K,)``."""
        return self._thresholds.copy()

    def metrics(self) -> dict[str, float]:
        """Return the emitters' metrics and the mean threshold."""
        return {**super().metrics(), "threshold_mean": float(self._thresholds.mean())}

    def _judge(self, fitness: Fitness, added: AddResult) -> tuple[Fitness, bool]:
        rate = self.settings.learning_rate
        improvement = np.zeros(len(fitness))
        # One genome after the other, as in lines 8 to 14 of the algorithm.
        for index in np.flatnonzero(added.cells != NO_CELL):
            cell = added.cells[index]
            improvement[index] = fitness[index] - self._thresholds[cell]
            if improvement[index] > 0.0:
                raised = (1.0 - rate) * self._thresholds[cell] + rate * fitness[index]
                self._thresholds[cell] = raised
        stage = np.zeros(len(fitness), dtype=np.int64)
        values = without_cell_worst(stage, improvement, fitness, added)
        return values, bool((improvement > 0.0).any())

    def _state(self) -> State:
        return {**super()._state(), "thresholds": self._thresholds.copy()}

    def _load_state(self, state: Mapping[str, Any]) -> None:
        check_like(state["thresholds"], self._thresholds, "thresholds", may_be_infinite=True)
        super()._load_state(state)
        self._thresholds = np.array(state["thresholds"], dtype=np.float64)
