"""The number that a search maximises: a base, and bonuses on it. Source: paper section 6."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs.engines.base import Evaluation
from ncrs_envs.errors import NCRSError
from ncrs_envs.registry import Registry
from ncrs_envs.tasks import TaskSettings, playfield

FITNESS = "fitness"
"""Name of the paper's objective, the mean reward."""
SOFT_SUCCESS = "soft_success"
_SOFT_WEIGHT = 0.4
_SOFT_RANGE = 0.2
"""Share of the playfield's half side P over which a failure's value falls by 1/e."""

ObjectiveFunction = Callable[[Evaluation, TaskSettings], NDArray[np.float64]]
"""Function of an evaluation of P genomes and the task's settings that returns the value of each,
``(P,)``: more is better, NaN ranks worst."""


class ObjectiveError(NCRSError, ValueError):
    """An objective that is unknown, or whose values are malformed."""


def _fitness(evaluation: Evaluation, settings: TaskSettings) -> NDArray[np.float64]:
    return evaluation.fitness


def soft_success(evaluation: Evaluation, settings: TaskSettings) -> NDArray[np.float64]:
    """Compute the fraction of successes, where failures count more the nearer they came.

    An episode's value is its success, 1 or 0, plus ``0.4 exp(-max(d - r, 0) / 0.2 P)``, with the
    closest approach ``d`` to what success is about (the light, or the ball's to the target), the
    success radius ``r`` and the playfield's half side P. Where the automaton's state became
    non-finite the genome's value is NaN.
    """
    missed = np.maximum(evaluation.closest[..., -1] - settings.radius, 0.0)
    extent = playfield(settings.grid_size)
    values = evaluation.success + _SOFT_WEIGHT * np.exp(-missed / (_SOFT_RANGE * extent))
    mean = values.mean(axis=1)
    # Bodies that cannot try are told apart by their parts, as in the fitness.
    return np.where(evaluation.valid & np.isfinite(evaluation.fitness), mean, evaluation.fitness)


OBJECTIVES: Registry[ObjectiveFunction] = Registry(
    "objective", {FITNESS: _fitness, SOFT_SUCCESS: soft_success}
)


def register_objective(name: str, function: ObjectiveFunction) -> None:
    """Make an objective known by name; raise ``ExtensionError`` if that is taken."""
    OBJECTIVES.register(name, function)


def check_objective(name: Any) -> str:
    """Return ``name`` if it is an objective, else raise ``ObjectiveError``."""
    return OBJECTIVES.check(name, "objective", ObjectiveError)


@dataclass(frozen=True)
class Objective:
    """The value that the search maximises: that of an objective function, and bonuses.

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
    name: str = FITNESS
    """Name of the function, one of ``OBJECTIVES``."""
    recovery_bonus: float = 0.0
    """Added to an episode's mean reward, times the fraction of the lost modules that are back."""

    def __call__(self, evaluation: Evaluation) -> NDArray[np.float64]:
        """Compute the objective of each genome, float64 ``(P,)``.

        Raises:
            ObjectiveError: If a registered function returns another shape.
        """
        values = np.asarray(OBJECTIVES[self.name](evaluation, self.settings), dtype=np.float64)
        if values.shape != evaluation.fitness.shape:
            raise ObjectiveError(
                f"The objective {self.name!r} must return one value per genome, shape "
                f"{evaluation.fitness.shape}, got {values.shape}."
            )
        extent = playfield(self.settings.grid_size)
        approach = np.exp(-evaluation.closest / extent).mean(axis=-1)
        bonus = self.success_bonus * evaluation.success + self.approach_bonus * approach
        back = np.where(evaluation.valid[:, None], evaluation.recovered, 0.0)
        bonus = bonus + self.recovery_bonus * back
        return np.asarray(values + bonus.mean(axis=1))
