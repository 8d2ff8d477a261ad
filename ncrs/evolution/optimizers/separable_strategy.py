"""CMA-ES with variances only, or with none, in numpy.

It is a search by pycma with the same options, bit for bit: sums and products are made in pycma's
order, on whole populations. Sources: Hansen 2016, "The CMA Evolution Strategy: A Tutorial"
(equation numbers below); Hansen 2008, "Adaptive Encoding", for the variances; and pycma.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ncrs.evolution.optimizers.constants import Constants, Vector
from ncrs.evolution.optimizers.step_size import step_size_of
from ncrs.evolution.schema import check_like, check_names


class SeparableStrategy:
    """What ``CMAES`` uses of ``cma.CMAEvolutionStrategy``, for a diagonal covariance.

    Args:
        template: Strategy of pycma with the options in use, for its constants.
        start: First mean, ``(N,)``.
        generator: Generator of the samples.
    """

    def __init__(self, template: Any, start: Vector, generator: np.random.Generator) -> None:
        self.constants = Constants.read(template)
        self.mean = np.array(start, dtype=np.float64)
        self.scales = np.ones_like(self.mean)
        self.sigma = float(template.sigma)
        self._generator = generator
        self._step_size = step_size_of(template)
        self._ps = np.zeros_like(self.mean)
        self._pc = np.zeros_like(self.mean)
        self._count = 0
        # The population; and the path with the genomes in their order, then the squares of both.
        # Made by the first ``ask`` and kept: new pages take longer than what is computed in them.
        self._genomes = np.empty((0, len(self.mean)))
        self._vectors = np.empty((0, len(self.mean)))

    @property
    def condition_number(self) -> float:
        """Condition number of the covariance."""
        return float((self.scales.max() / self.scales.min()) ** 2)

    def ask(self, number: int) -> Vector:
        """Draw a population, ``(number, N)``, in an array that the next call fills again."""
        if len(self._genomes) != number:
            self._genomes = np.empty((number, len(self.mean)))
            self._vectors = np.zeros((number + 1, len(self.mean)))
        genomes = self._genomes
        lines = self._step_size.lines(self.scales, self.sigma, self._generator)
        genomes[: len(lines)] = lines
        drawn = genomes[len(lines) :]
        # Equations 38 to 40.
        self._generator.standard_normal(out=drawn)
        drawn *= self.scales
        genomes *= self.sigma
        genomes += self.mean
        return genomes

    def tell(self, values: Vector) -> None:
        """Learn from the values of the population that was asked for, smaller is better."""
        constants, ranked = self.constants, self._vectors[1:]
        weights, order = constants.weights(len(values)), np.argsort(values)
        # Rows without weight stay zero: they keep the order in which BLAS sums the others.
        worst = len(values) - np.count_nonzero(weights < 0.0)
        weighted = (slice(0, constants.parents), slice(worst, len(values)))
        for ranks in weighted:
            # The default mode would fill a buffer first.
            np.take(self._genomes, order[ranks], axis=0, out=ranked[ranks], mode="clip")
        self._count += 1
        # Equations 41 and 42: recombination.
        old = self.mean
        self.mean = np.dot(weights[: constants.parents], ranked[: constants.parents])
        step = self.mean - old
        # Equation 43: the path of sigma, in which C^-1/2 y = y / scales.
        white = step / self.scales
        white *= constants.effective**0.5 / self.sigma
        self._ps *= 1.0 - constants.cs
        self._ps += constants.gain * white
        squared = np.sum(self._ps**2)
        # Equation 45, in the coordinates of the samples.
        path = constants.path(float(squared), self._count)
        self._pc = path.kept * self._pc + path.added / self.sigma * step / self.scales
        if path.rate + constants.cmu > 0.0:
            for ranks in weighted:
                rows = ranked[ranks]
                rows -= old
                rows /= self.sigma * self.scales
                np.square(rows, out=rows)
            self._learn(np.concatenate(([path.rate], constants.cmu * weights)))
        self.sigma *= self._step_size.factor(float(np.sqrt(squared)), step, values)

    def _learn(self, rates: Vector) -> None:
        """Learn the scales from the squares of the path and of the genomes, at their rates."""
        self._vectors[0] = self._pc**2
        # Equation 47 for the diagonal, as a product: 1 + r (z^2 - 1) becomes 2^(r (z^2 - 1)).
        rates = np.log(2.0) * rates
        average = np.dot(rates, self._vectors)
        # The builtin sum adds one after the other, as pycma does.
        self.scales *= np.exp((average - sum(rates)) / 2.0)

    # State.

    def unasked(self) -> dict[str, Any]:
        """Return the part of the state that asking changes: none, but for the generator's."""
        return {}

    def state(self) -> dict[str, Any]:
        """Return arrays and JSON values from which ``load_state`` continues bit for bit."""
        return {
            "mean": self.mean.copy(),
            "scales": self.scales.copy(),
            "ps": self._ps.copy(),
            "pc": self._pc.copy(),
            "sigma": self.sigma,
            "count": self._count,
            **self._step_size.state(),
        }

    def load_state(self, state: Mapping[str, Any]) -> None:
        """Continue from a ``state``; raise ``StoredStateError`` if it is incomplete or foreign."""
        name = "The state of the separable search"
        reference = self.state()
        check_names(state, reference, name, ())
        for key, value in reference.items():
            check_like(state[key], value, f"{name}.{key}")
        self.mean, self.scales = np.array(state["mean"]), np.array(state["scales"])
        self._ps, self._pc = np.array(state["ps"]), np.array(state["pc"])
        self.sigma, self._count = float(state["sigma"]), int(state["count"])
        self._step_size.load_state(state)
