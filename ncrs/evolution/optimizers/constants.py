"""The constants of CMA-ES, for the strategies that are not pycma's own.

They are those of a strategy of pycma with the options in use. Sources: Hansen 2016, "The CMA
Evolution Strategy: A Tutorial" (equation numbers below), and pycma.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncrs.evolution.optimizers.pycma import CMAAdaptSigmaCSA

Vector = NDArray[np.float64]


class Path(NamedTuple):
    """Coefficients of the path pc, and the learning rate of its product."""

    kept: float
    added: float
    c1: float
    h: float
    """0 where the path of sigma is long, else 1."""
    cc: float

    @property
    def rate(self) -> float:
        """The learning rate, with the loss of variance where ``h`` is 0."""
        return self.c1 * (1.0 - (1.0 - self.h) * self.cc * (2.0 - self.cc))


@dataclass(frozen=True)
class Constants:
    """Constants of one search; the symbols are the source's."""

    dimension: int
    """Number of variables N."""
    recombination: Any
    """pycma's weights for its own population."""
    effective: float
    """Variance-effective number of parents, mu_eff."""
    cs: float
    gain: float
    """Root of cs (2 - cs)."""
    cc: float
    c1: float
    cmu: float

    @classmethod
    def read(cls, template: Any) -> Constants:
        """Read the constants of a ``cma.CMAEvolutionStrategy``, which may be new."""
        sp, adaptation = template.sp, template.adapt_sigma
        rates = (sp.cc_sep, sp.c1_sep, sp.cmu_sep)
        if not template.opts["CMA_diagonal"]:
            full = template.sm.parameters(mueff=sp.weights.mueff, lam=sp.weights.lambda_)
            rates = (sp.cc, full["c1"], full["cmu"])
        by_path = isinstance(adaptation, CMAAdaptSigmaCSA)
        if not by_path:
            adaptation.initialize_base(template)  # as pycma does in the first generation
        square = adaptation.cs * (2.0 - adaptation.cs)
        return cls(
            template.N,
            sp.weights,
            float(sp.weights.mueff),
            float(adaptation.cs),
            # A power may round differently from a root; pycma has either.
            float(np.sqrt(square) if by_path else square**0.5),
            *(float(rate) for rate in rates),
        )

    @property
    def parents(self) -> int:
        """Number mu of the genomes that are recombined."""
        return int(self.recombination.mu)

    def weights(self, population: int) -> Vector:
        """Return the weights of a population, ``(population,)``, from the best genome's on.

        Those of the parents are positive, those of the worst genomes negative.
        """
        return np.asarray(self.recombination(population), dtype=np.float64)

    def path(self, squared: float, count: int) -> Path:
        """Return the coefficients of the path pc, equation 45.

        Args:
            squared: Squared length of the path of sigma.
            count: Number of generations told, the present one included.
        """
        # Of the length that the path would have without its start at zero.
        unbiased = squared / (1.0 - (1.0 - self.cs) ** (2 * count))
        is_short = unbiased / self.dimension - 1.0 < 1.0 + 4.0 / (self.dimension + 1)
        h = 1.0 if is_short else 0.0
        added = h * (self.cc * (2.0 - self.cc) * self.effective) ** 0.5
        return Path(1.0 - self.cc, added, self.c1, h, self.cc)
