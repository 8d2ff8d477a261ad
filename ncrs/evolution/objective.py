"""The number that a search maximises: the fitness, and bonuses on it. Source: paper section 6."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ncrs.engines.base import Evaluation
from ncrs_envs.tasks import TaskSettings, playfield


@dataclass(frozen=True)
class Objective:
    """Mean over the episodes of the value that the search maximises.

    The paper's fitness is the mean reward, which hardly changes when a robot finally comes near
    enough to succeed. The paper's discussion suggests shaping it by success.
    """

    settings: TaskSettings
    success_bonus: float = 0.0
    """Added to the mean reward of an episode that succeeds."""
    approach_bonus: float = 0.0
    """Added to an episode's mean reward, times ``exp(-d / P)`` with the closest approach ``d`` to
    the light and the playfield's half side P. In CarryBall the factor is the mean for the robot's
    closest approach to the ball and the ball's to the target."""

    def __call__(self, evaluation: Evaluation) -> NDArray[np.float64]:
        """Compute the objective of each genome, float64 ``(P,)``."""
        extent = playfield(self.settings.grid_size)
        approach = np.exp(-evaluation.closest / extent).mean(axis=-1)
        bonus = self.success_bonus * evaluation.success + self.approach_bonus * approach
        return np.asarray(evaluation.fitness + bonus.mean(axis=1))
