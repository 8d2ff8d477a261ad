"""What a search maximises: the fitness, and what may be added to it. Source: paper section 6."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncrs.engines.base import Evaluation
from ncrs_envs.tasks import TaskSettings, playfield


def objective(
    evaluation: Evaluation,
    settings: TaskSettings,
    success_bonus: float = 0.0,
    approach_bonus: float = 0.0,
) -> NDArray[np.float64]:
    """Mean over the episodes of what the search should maximise, for each genome.

    The fitness of the paper is the mean reward, which hardly changes when a robot comes near enough
    at last. The paper's discussion suggests to shape it by success.

    Args:
        evaluation: of some genomes.
        settings: the task's.
        success_bonus: what an episode that succeeds earns beside its mean reward.
        approach_bonus: what an episode earns for its closest approach ``d`` to the light, times
            ``exp(-d / P)`` with the playfield's half side P; in CarryBall the mean for the robot's
            closest approach to the ball and the ball's to the target.

    Returns:
        float64, one value per genome.
    """
    approach = np.exp(-evaluation.closest / playfield(settings.grid_size)).mean(axis=-1)
    bonus = success_bonus * evaluation.success + approach_bonus * approach
    return np.asarray(evaluation.fitness + bonus.mean(axis=1))
