"""CMA-ES with a full covariance whose whole state stays on one device of torch, such as a GPU.

The constants are pycma's, read from a strategy of its own, and the updates are those that it makes
with these options, so that the two differ in rounding alone. Sources: Hansen 2016, "The CMA
Evolution Strategy: A Tutorial" (equation numbers below), and pycma.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from ncrs.evolution.optimizers.cholesky_sampler import CholeskySampler
from ncrs.evolution.optimizers.pycma import Mh
from ncrs.evolution.schema import check_like, check_names

Vector = NDArray[np.float64]


class DeviceStrategy:
    """What ``CMAES`` uses of ``cma.CMAEvolutionStrategy``, computed on a device.

    Args:
        template: Strategy of pycma with the options in use, for its constants.
        sampler: Zero-mean distribution, whose device is used.
        start: First mean, ``(N,)``.
        seed: Seed of the samples.
    """

    def __init__(self, template: Any, sampler: CholeskySampler, start: Vector, seed: int) -> None:
        self._template = template
        self.sm = sampler
        self.N = sampler.dimension
        self.sigma = float(template.sigma)
        self._generator = torch.Generator(sampler.device)
        self._generator.manual_seed(seed)
        self._mean = self._vector(start)
        self._ps = torch.zeros_like(self._mean)
        self._pc = torch.zeros_like(self._mean)
        self._count = 0
        self._z: torch.Tensor | None = None
        self._y: torch.Tensor | None = None

    def _vector(self, values: Any) -> torch.Tensor:
        return torch.tensor(values, dtype=torch.float64, device=self.sm.device)

    @property
    def mean(self) -> Vector:
        """Mean of the search distribution, ``(N,)``."""
        mean: Vector = self._mean.cpu().numpy()
        return mean

    @property
    def condition_number(self) -> float:
        """Estimate of the covariance's condition number."""
        return self.sm.condition_number

    def ask(self, number: int) -> Vector:
        """Draw a population, ``(number, N)``."""
        self.sm.update_now()
        self._z = torch.randn(
            (number, self.N),
            generator=self._generator,
            dtype=self.sm.dtype,
            device=self.sm.device,
        )
        self._y = self.sm.times_factor(self._z)
        genomes: Vector = (self._mean + self.sigma * self._y.double()).cpu().numpy()
        return genomes

    def tell(self, genomes: Sequence[Any], values: Sequence[float]) -> None:
        """Learn from the values of the population that was asked for, smaller is better."""
        assert self._z is not None
        assert self._y is not None
        constants, sampler = self._template.sp, self.sm
        order = torch.from_numpy(np.argsort(np.asarray(values))).to(sampler.device)
        y, z = self._y[order], self._z[order]
        self._z = self._y = None
        self._count += 1
        weights = np.asarray(constants.weights(len(values)), dtype=np.float64)
        parents = constants.weights.mu
        positive = self._vector(weights[:parents])
        effective = float(constants.weights.mueff)
        # Equations 41 and 42: recombination.
        shift = positive @ y[:parents].double()
        self._mean = self._mean + self.sigma * shift
        # Equation 43: the path of sigma, in which C^-1/2 y = z.
        adaptation = self._template.adapt_sigma
        cs = float(adaptation.cs)
        white_shift = math.sqrt(effective) * (positive @ z[:parents].double())
        self._ps = (1.0 - cs) * self._ps + math.sqrt(cs * (2.0 - cs)) * white_shift
        squared = float(self._ps.square().sum())
        is_short = squared / (1.0 - (1.0 - cs) ** (2 * self._count)) / self.N - 1.0
        h = 1.0 if is_short < 1.0 + 4.0 / (self.N + 1) else 0.0
        # Equations 45 to 47: the path of C, and C itself.
        cc, c1, cmu = self._rates()
        self._pc = (1.0 - cc) * self._pc + h * math.sqrt(cc * (2.0 - cc) * effective) * shift
        c1a = c1 * (1.0 - (1.0 - h) * cc * (2.0 - cc))
        path = math.sqrt(c1 / (c1a + 1e-23)) * self._pc
        sampler.learn(
            torch.cat([path.to(sampler.dtype)[None], y]),
            np.concatenate([[c1a], cmu * weights]),
            torch.cat([torch.ones(1, dtype=z.dtype, device=z.device), z.norm(dim=1)]),
        )
        self.sigma *= self._sigma_factor(math.sqrt(squared))

    def _rates(self) -> tuple[float, float, float]:
        """Return the learning rates cc, c1 and cmu."""
        constants = self._template.sp
        rates = self._template.sm.parameters(
            mueff=constants.weights.mueff, lam=constants.weights.lambda_
        )
        return float(constants.cc), float(rates["c1"]), float(rates["cmu"])

    def _sigma_factor(self, length: float) -> float:
        """Return the change of sigma for a path of this length, equation 44."""
        adaptation, options = self._template.adapt_sigma, self._template.opts
        if options["CSA_squared"]:
            excess = (length**2 / self.N - 1.0) / 2.0
        else:
            excess = length / float(Mh.chiN(self.N)) - 1.0
        change = excess * adaptation.cs / adaptation.damps / options["CSA_dampfac"]
        if change < 0:
            change /= adaptation.dampdown_fac
        limit = adaptation.max_delta_log_sigma
        return math.exp(min(max(change, -limit), limit))

    # State.

    def unasked(self) -> dict[str, Any]:
        """Return the part of the state that asking changes."""
        return {"generator": self._generator.get_state().numpy().copy()}

    def state(self) -> dict[str, Any]:
        """Return arrays and JSON values from which ``load_state`` continues bit for bit."""
        return {
            "mean": self.mean,
            "ps": self._ps.cpu().numpy(),
            "pc": self._pc.cpu().numpy(),
            "sigma": self.sigma,
            "count": self._count,
            **self.unasked(),
            "sm": self.sm.state(),
        }

    def load_state(self, state: Mapping[str, Any]) -> None:
        """Continue from a ``state``; raise ``StateError`` if it is incomplete or malformed."""
        name = "The state of the search on a device"
        reference = self.state()
        check_names(state, reference, name, ())
        for key, value in reference.items():
            if key != "sm":
                check_like(state[key], value, f"{name}.{key}")
        self.sm.load_state(state["sm"])
        self._generator.set_state(torch.from_numpy(np.array(state["generator"])))
        self._mean = self._vector(state["mean"])
        self._ps = self._vector(state["ps"])
        self._pc = self._vector(state["pc"])
        self.sigma = float(state["sigma"])
        self._count = int(state["count"])
