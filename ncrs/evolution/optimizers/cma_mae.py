"""CMA-MAE: CMA-ME with an archive whose thresholds rise slowly.

Source: Fontaine and Nikolaidis 2023, "Covariance Matrix Adaptation MAP-Annealing", algorithm 1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ncrs.evolution.archive import NO_CELL, AddResult, Archive
from ncrs.evolution.optimizers.base import Fitness, OptimizerError, State
from ncrs.evolution.optimizers.emitters import EMITTERS, EmitterOptimizer
from ncrs.evolution.optimizers.quality_diversity import without_cell_worst


class CMAMAE(EmitterOptimizer):
    """CMA-MAE from mean 0.

    Every cell has a threshold ``t``, at first ``threshold_min``. Genomes are ranked by
    ``fitness - t`` of their cell, and one that exceeds its threshold moves it to
    ``(1 - learning_rate) t + learning_rate fitness``. With learning rate 1 the thresholds are the
    elites' fitness, as in CMA-ME; with 0 this is CMA-ES on plain fitness.

    Args:
        dimension: length N of a genome.
        seed: of the choice of elites; the emitters' seeds follow from it.
        emitters: number of emitters.
        patience: turns without a fitness above its threshold before an emitter restarts. (The
            method's authors restart on CMA-ES's own convergence, which noise prevents here.)
        learning_rate: of the thresholds, 0 to 1 (alpha in the source).
        threshold_min: lowest fitness worth having; fitness here is never negative.
        sigma, population, told_popsize, step_size, diagonal, linear_algebra, precision, device: of
            each emitter, see ``CMAES``.
    """

    name: ClassVar[str] = "cma_mae"

    def __init__(
        self,
        dimension: int,
        seed: np.random.SeedSequence,
        *,
        emitters: int = EMITTERS,
        patience: int = 500,
        learning_rate: float = 0.01,
        threshold_min: float = 0.0,
        sigma: float = 0.01,
        population: int = 128,
        told_popsize: bool = True,
        step_size: str = "csa",
        diagonal: bool = False,
        linear_algebra: str | None = None,
        precision: str | None = None,
        device: str | None = None,
    ) -> None:
        if not 0.0 <= learning_rate <= 1.0:
            raise OptimizerError(f"learning_rate must be from 0 to 1, got {learning_rate!r}.")
        if not math.isfinite(threshold_min):
            raise OptimizerError(f"threshold_min must be finite, got {threshold_min!r}.")
        self._learning_rate = float(learning_rate)
        self._threshold_min = float(threshold_min)
        self._thresholds: NDArray[np.float64] = np.empty(0)
        super().__init__(
            dimension,
            seed,
            emitters=emitters,
            patience=patience,
            settings={
                "sigma": sigma,
                "population": population,
                "told_popsize": told_popsize,
                "step_size": step_size,
                "diagonal": diagonal,
                "linear_algebra": linear_algebra,
                "precision": precision,
                "device": device,
            },
        )

    def attach(self, archive: Archive) -> None:
        super().attach(archive)
        self._thresholds = np.full(len(archive.space.triples), self._threshold_min)

    @property
    def settings(self) -> dict[str, Any]:
        return {
            **super().settings,
            "learning_rate": self._learning_rate,
            "threshold_min": self._threshold_min,
        }

    @property
    def thresholds(self) -> NDArray[np.float64]:
        """A copy of the threshold of every cell, ``(K,)``."""
        return self._thresholds.copy()

    def metrics(self) -> dict[str, float]:
        return {**super().metrics(), "threshold_mean": float(self._thresholds.mean())}

    def _judge(self, fitness: Fitness, added: AddResult) -> tuple[Fitness, bool]:
        rate = self._learning_rate
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
        super()._load_state(state)
        self._thresholds = np.array(state["thresholds"], dtype=np.float64)
