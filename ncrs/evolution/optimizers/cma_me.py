"""CMA-ME: CMA-ES emitters that are rewarded for what they add to the archive.

Source: paper section 5; Fontaine, Togelius, Nikolaidis and Hoover 2020, algorithm 2.
"""

from __future__ import annotations

import numpy as np

from ncrs.evolution.archive import AddResult, AddStatus
from ncrs.evolution.optimizers.base import Fitness
from ncrs.evolution.optimizers.emitters import EmitterOptimizer
from ncrs.evolution.optimizers.quality_diversity import without_cell_worst
from ncrs.evolution.optimizers.settings import CMAMESettings


class CMAME(EmitterOptimizer):
    """CMA-ME from mean 0; see ``EmitterOptimizer`` for the arguments."""

    settings: CMAMESettings

    def _judge(self, fitness: Fitness, added: AddResult) -> tuple[Fitness, bool]:
        useful = bool((added.status != AddStatus.NONE).any())
        if self.settings.ranking == "fitness":
            return fitness, useful
        stage = added.status.astype(np.int64)
        return without_cell_worst(stage, added.improvement, fitness, added), useful
