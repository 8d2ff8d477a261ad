"""CMA-ME: CMA-ES emitters that are rewarded for what they add to the archive.

Source: paper section 5; Fontaine, Togelius, Nikolaidis and Hoover 2020, algorithm 2.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ncrs.evolution.archive import AddResult, AddStatus
from ncrs.evolution.optimizers.base import Fitness, OptimizerError
from ncrs.evolution.optimizers.emitters import EMITTERS, EmitterOptimizer
from ncrs.evolution.optimizers.quality_diversity import without_cell_worst

RANKINGS = ("improvement", "fitness")


class CMAME(EmitterOptimizer):
    """CMA-ME from mean 0.

    Args:
        dimension: length N of a genome.
        seed: of the choice of elites; the emitters' seeds follow from it.
        emitters: number of emitters, 15 in the paper.
        patience: turns without an addition before an emitter restarts, 500 in the paper.
        ranking: "improvement", as the method was published: genomes that filled an empty cell
            come first, then those that improved one, then the rest, each by improvement; or
            "fitness", as in the published runs of the paper.
        sigma, population, told_popsize, step_size, diagonal, linear_algebra, precision, device: of
            each emitter, see ``CMAES``.
    """

    name: ClassVar[str] = "cma_me"

    def __init__(
        self,
        dimension: int,
        seed: np.random.SeedSequence,
        *,
        emitters: int = EMITTERS,
        patience: int = 500,
        ranking: str = "improvement",
        sigma: float = 0.01,
        population: int = 128,
        told_popsize: bool = True,
        step_size: str = "csa",
        diagonal: bool = False,
        linear_algebra: str | None = None,
        precision: str | None = None,
        device: str | None = None,
    ) -> None:
        if ranking not in RANKINGS:
            raise OptimizerError(f"ranking must be one of {list(RANKINGS)}, got {ranking!r}.")
        self._ranking = ranking
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

    @property
    def settings(self) -> dict[str, Any]:
        return {**super().settings, "ranking": self._ranking}

    @property
    def maximises_fitness(self) -> bool:
        return self._ranking == "fitness"

    def _judge(self, fitness: Fitness, added: AddResult) -> tuple[Fitness, bool]:
        useful = bool((added.status != AddStatus.NONE).any())
        if self._ranking == "fitness":
            return fitness, useful
        stage = added.status.astype(np.int64)
        return without_cell_worst(stage, added.improvement, fitness, added), useful
