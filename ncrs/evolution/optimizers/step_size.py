"""Adaptation of the step size sigma, for the strategies that are not pycma's own.

The constants are pycma's. Sources: Hansen 2016, "The CMA Evolution Strategy: A Tutorial", and
Hansen, Atamna and Auger 2014, "How to Assess Step-Size Adaptation Mechanisms in Randomised Search",
as pycma has it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np

from ncrs.evolution.optimizers.constants import Vector
from ncrs.evolution.optimizers.pycma import CMAAdaptSigmaCSA, Mh


class StepSize(ABC):
    """What changes sigma, and the part of the population that serves it."""

    def lines(self, scales: Vector, sigma: float, generator: np.random.Generator) -> Vector:
        """Return the steps over sigma that come first in the next population, ``(K, N)``.

        Args:
            scales: Standard deviations over sigma, ``(N,)``.
            sigma: Step size.
            generator: Generator of the search.
        """
        return np.empty((0, len(scales)))

    @abstractmethod
    def factor(self, length: float, step: Vector, values: Vector) -> float:
        """Return the change of sigma.

        Args:
            length: Length of the path of sigma.
            step: The mean's step, ``(N,)``.
            values: Values of the population in the order asked for, ``(P,)``, smaller is better.
        """

    @abstractmethod
    def state(self) -> dict[str, Any]:
        """Return what the future depends on, beside the arguments of the two methods above."""

    @abstractmethod
    def load_state(self, state: Mapping[str, Any]) -> None:
        """Continue from a checked ``state``."""


class PathLength(StepSize):
    """Sigma grows while its path is longer than a random one, Hansen 2016, equation 44.

    Args:
        template: ``cma.CMAEvolutionStrategy`` with the options in use.
    """

    def __init__(self, template: Any) -> None:
        adaptation, options = template.adapt_sigma, template.opts
        self._expected = float(Mh.chiN(template.N))
        self._rate = adaptation.cs / adaptation.damps
        self._damping = options["CSA_dampfac"]
        self._damping_down = adaptation.dampdown_fac
        self._limit = adaptation.max_delta_log_sigma

    def factor(self, length: float, step: Vector, values: Vector) -> float:
        """Return the change of sigma, see ``StepSize``."""
        return self.factor_of(length)

    def factor_of(self, length: float) -> float:
        """Return the change of sigma for a path of a length."""
        change = (length / self._expected - 1.0) * self._rate / self._damping
        if change < 0:
            change /= self._damping_down
        return float(np.exp(min(max(change, -self._limit), self._limit)))

    def state(self) -> dict[str, Any]:
        """Return nothing: the search keeps the path."""
        return {}

    def load_state(self, state: Mapping[str, Any]) -> None:
        """Continue from a checked ``state``."""


class TwoPoints(StepSize):
    """Sigma grows where a step along the mean's last one ranks better than one against it.

    Args:
        template: ``cma.CMAEvolutionStrategy`` with the options in use.
    """

    def __init__(self, template: Any) -> None:
        self._constants = template.adapt_sigma.sp
        self._damping = template.opts["TPA_dampfac"]
        self._trend = 0.0
        self._step = np.zeros(template.N)

    def lines(self, scales: Vector, sigma: float, generator: np.random.Generator) -> Vector:
        """Return a step along the mean's last one and its mirror image, see ``StepSize``.

        They are as long as random ones. There are none in the first generation, nor where the mean
        did not move.
        """
        if not self._step.any():
            return super().lines(scales, sigma, generator)

        def length(line: Vector) -> Any:
            return np.sqrt(np.sum((line / scales) ** 2)) / sigma

        def drawn_length() -> Any:
            return np.sum(generator.standard_normal((1, len(scales)))[0] ** 2) ** 0.5

        along, against = self._step.copy(), -self._step
        for line in (along, against):
            # pycma shortens long steps before it scales the two; the draws are its own.
            is_long = length(line) > len(line) ** 0.5
            line *= (drawn_length() / length(line) if is_long else 1.0) / sigma
        along *= drawn_length() / length(along) / sigma
        against *= (np.sum(along**2) / np.sum(against**2)) ** 0.5
        return np.stack([along, against])

    def factor(self, length: float, step: Vector, values: Vector) -> float:
        """Return the change of sigma, see ``StepSize``."""
        self._step = step
        along, against = values[:2]
        ranks = np.sum(values < against) - np.sum(values < along)
        change = ranks / (len(values) - 1)
        constants = self._constants
        learned = constants.c * np.sign(change) * np.abs(change) ** constants.z_exponent
        self._trend = float((1.0 - constants.c) * self._trend + learned)
        damping_down = constants.dampdown_fac if self._trend < 0 else 1.0
        return float(np.exp(self._trend / constants.damp / self._damping / damping_down))

    def state(self) -> dict[str, Any]:
        """Return what the future depends on."""
        return {"trend": self._trend, "step": self._step.copy()}

    def load_state(self, state: Mapping[str, Any]) -> None:
        """Continue from a checked ``state``."""
        self._trend = float(state["trend"])
        self._step = np.array(state["step"])


def step_size_of(template: Any) -> StepSize:
    """Make the adaptation that a ``cma.CMAEvolutionStrategy`` uses."""
    by_path = isinstance(template.adapt_sigma, CMAAdaptSigmaCSA)
    return PathLength(template) if by_path else TwoPoints(template)
