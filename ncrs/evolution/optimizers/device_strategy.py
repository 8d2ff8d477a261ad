"""CMA-ES whose whole state stays on one device of torch, such as a GPU.

The constants are pycma's, read from a strategy of its own, and the updates are those that it makes
with these options, so that the two differ in rounding alone. Sources: Hansen 2016, "The CMA
Evolution Strategy: A Tutorial" (equation numbers below), and pycma.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from ncrs.automaton.device_genomes import DeviceGenomes
from ncrs.evolution.optimizers.cholesky_sampler import CholeskySampler, check_device
from ncrs.evolution.optimizers.pycma import Mh
from ncrs.evolution.schema import check_like, check_names

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


class DeviceStrategy(ABC):
    """What ``CMAES`` uses of ``cma.CMAEvolutionStrategy``, computed on a device.

    Args:
        template: Strategy of pycma with the options in use, for its constants.
        device: Device of torch.
        start: First mean, ``(N,)``.
        seed: Seed of the samples.
    """

    dtype: torch.dtype

    def __init__(self, template: Any, device: torch.device, start: Vector, seed: int) -> None:
        self._template = template
        self._device = device
        self.N = len(start)
        self.sigma = float(template.sigma)
        self._generator = torch.Generator(device)
        self._generator.manual_seed(seed)
        self._mean = self._vector(start)
        self._ps = torch.zeros_like(self._mean)
        self._pc = torch.zeros_like(self._mean)
        self._count = 0
        self._z: torch.Tensor | None = None

    def _vector(self, values: Any) -> torch.Tensor:
        return torch.tensor(values, dtype=torch.float64, device=self._device)

    @property
    def mean(self) -> Vector:
        """Mean of the search distribution, ``(N,)``."""
        mean: Vector = self._mean.cpu().numpy()
        return mean

    @property
    @abstractmethod
    def condition_number(self) -> float:
        """Condition number of the covariance."""

    @abstractmethod
    def _steps(self, z: torch.Tensor) -> torch.Tensor:
        """Return the steps ``C^(1/2) z`` of standard normal vectors, ``(K, N)``."""

    @abstractmethod
    def _shift(self, weights: torch.Tensor, white_shift: torch.Tensor) -> torch.Tensor:
        """Return the mean's step over sigma, given that of the parents' white vectors."""

    @abstractmethod
    def _rates(self) -> tuple[float, float, float]:
        """Return the learning rates cc, c1 and cmu."""

    @abstractmethod
    def _adapt(self, shift: torch.Tensor, path: Path, z: torch.Tensor, weights: Vector) -> None:
        """Learn the covariance.

        Args:
            shift: The mean's step over sigma.
            path: Coefficients of the path pc, and learning rate of its product.
            z: White vectors of the population, the best first.
            weights: Learning rates of the population's products.
        """

    def ask(self, number: int) -> DeviceGenomes:
        """Draw a population, ``(number, N)``."""
        self._z = torch.randn(
            (number, self.N), generator=self._generator, dtype=self.dtype, device=self._device
        )
        steps = self._steps(self._z)
        return DeviceGenomes(self._mean + self.sigma * steps.double())

    def tell(self, genomes: Any, values: Sequence[float]) -> None:
        """Learn from the values of the population that was asked for, smaller is better.

        The genomes are not read: what they were made of is at hand.
        """
        assert self._z is not None
        constants = self._template.sp
        order = torch.from_numpy(np.argsort(np.asarray(values))).to(self._device)
        z = self._z[order]
        self._z = None
        self._count += 1
        weights = np.asarray(constants.weights(len(values)), dtype=np.float64)
        parents = constants.weights.mu
        positive = self._vector(weights[:parents])
        effective = float(constants.weights.mueff)
        # Equations 41 and 42: recombination.
        white_shift = positive @ z[:parents].double()
        shift = self._shift(positive, white_shift)
        self._mean = self._mean + self.sigma * shift
        # Equation 43: the path of sigma, in which C^-1/2 y = z.
        cs = float(self._template.adapt_sigma.cs)
        gain = math.sqrt(cs * (2.0 - cs) * effective)
        self._ps = (1.0 - cs) * self._ps + gain * white_shift
        squared = float(self._ps.square().sum())
        is_short = squared / (1.0 - (1.0 - cs) ** (2 * self._count)) / self.N - 1.0
        h = 1.0 if is_short < 1.0 + 4.0 / (self.N + 1) else 0.0
        # Equations 45 to 47: the path of C, and C itself.
        cc, c1, cmu = self._rates()
        kept = Path(1.0 - cc, h * math.sqrt(cc * (2.0 - cc) * effective), c1, h, cc)
        self._adapt(shift, kept, z, cmu * weights)
        self.sigma *= self._sigma_factor(math.sqrt(squared))

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

    @abstractmethod
    def _covariance_state(self) -> dict[str, Any]:
        """Return the state of the covariance."""

    @abstractmethod
    def _load_covariance(self, state: Mapping[str, Any]) -> None:
        """Continue from the state of a covariance."""

    def state(self) -> dict[str, Any]:
        """Return arrays and JSON values from which ``load_state`` continues bit for bit."""
        return {
            "mean": self.mean,
            "ps": self._ps.cpu().numpy(),
            "pc": self._pc.cpu().numpy(),
            "sigma": self.sigma,
            "count": self._count,
            **self.unasked(),
            "sm": self._covariance_state(),
        }

    def load_state(self, state: Mapping[str, Any]) -> None:
        """Continue from a ``state``; raise ``StoredStateError`` if it is incomplete or foreign."""
        name = "The state of the search on a device"
        reference = self.state()
        check_names(state, reference, name, ())
        for key, value in reference.items():
            if key != "sm":
                check_like(state[key], value, f"{name}.{key}")
        self._load_covariance(state["sm"])
        self._generator.set_state(torch.from_numpy(np.array(state["generator"])))
        self._mean = self._vector(state["mean"])
        self._ps = self._vector(state["ps"])
        self._pc = self._vector(state["pc"])
        self.sigma = float(state["sigma"])
        self._count = int(state["count"])


class FullStrategy(DeviceStrategy):
    """A search with a full covariance.

    Args:
        template: Strategy of pycma with the options in use, for its constants.
        sampler: Zero-mean distribution, whose device is used.
        start: First mean, ``(N,)``.
        seed: Seed of the samples.
    """

    def __init__(self, template: Any, sampler: CholeskySampler, start: Vector, seed: int) -> None:
        super().__init__(template, sampler.device, start, seed)
        self.sm = sampler
        self.dtype = sampler.dtype

    @property
    def condition_number(self) -> float:
        """Estimate of the covariance's condition number."""
        return self.sm.condition_number

    def _steps(self, z: torch.Tensor) -> torch.Tensor:
        self.sm.update_now()
        return self.sm.times_factor(z)

    def _shift(self, weights: torch.Tensor, white_shift: torch.Tensor) -> torch.Tensor:
        return self.sm.times_factor(white_shift.to(self.dtype)[None])[0].double()

    def _rates(self) -> tuple[float, float, float]:
        constants = self._template.sp
        rates = self._template.sm.parameters(
            mueff=constants.weights.mueff, lam=constants.weights.lambda_
        )
        return float(constants.cc), float(rates["c1"]), float(rates["cmu"])

    def _adapt(self, shift: torch.Tensor, path: Path, z: torch.Tensor, weights: Vector) -> None:
        self._pc = path.kept * self._pc + path.added * shift
        scaled = math.sqrt(path.c1 / (path.rate + 1e-23)) * self._pc
        self.sm.learn(
            torch.cat([scaled.to(self.dtype)[None], self.sm.times_factor(z)]),
            np.concatenate([[path.rate], weights]),
            torch.cat([torch.ones(1, dtype=z.dtype, device=z.device), z.norm(dim=1)]),
        )

    def _covariance_state(self) -> dict[str, Any]:
        return self.sm.state()

    def _load_covariance(self, state: Mapping[str, Any]) -> None:
        self.sm.load_state(state)


class DiagonalStrategy(DeviceStrategy):
    """A search with variances only, or with none.

    The variances are those of pycma's ``DiagonalDecoding``: scales with exponential updates.
    """

    dtype = torch.float64

    def __init__(self, template: Any, device: str, start: Vector, seed: int) -> None:
        check_device(device)
        super().__init__(template, torch.device(device), start, seed)
        self._scales = torch.ones_like(self._mean)

    @property
    def condition_number(self) -> float:
        """Condition number of the covariance."""
        return float((self._scales.max() / self._scales.min()).square())

    def _steps(self, z: torch.Tensor) -> torch.Tensor:
        return self._scales * z

    def _shift(self, weights: torch.Tensor, white_shift: torch.Tensor) -> torch.Tensor:
        return self._scales * white_shift

    def _rates(self) -> tuple[float, float, float]:
        constants, learns = self._template.sp, self._template.opts["CMA_on"]
        return (
            float(constants.cc_sep),
            float(learns * constants.c1_sep),
            float(learns * constants.cmu_sep),
        )

    def _adapt(self, shift: torch.Tensor, path: Path, z: torch.Tensor, weights: Vector) -> None:
        self._pc = path.kept * self._pc + path.added * shift / self._scales
        if path.rate == 0.0 and not weights.any():
            return
        squared = torch.cat([self._pc[None], z]).square()
        rates = self._vector(math.log(2.0) * np.concatenate([[path.rate], weights]))
        factors = torch.exp(0.5 * (rates @ squared - rates.sum()))
        limits = 0.5 * (squared - 1.0).abs().amax(dim=0) + 1.0
        self._scales = self._scales * torch.where(
            factors > 1.0, torch.minimum(factors, limits), factors
        )

    def _covariance_state(self) -> dict[str, Any]:
        return {"scales": self._scales.cpu().numpy()}

    def _load_covariance(self, state: Mapping[str, Any]) -> None:
        reference = self._covariance_state()
        check_names(state, reference, "The state of the variances", ())
        check_like(state["scales"], reference["scales"], "scales")
        self._scales = self._vector(state["scales"])
