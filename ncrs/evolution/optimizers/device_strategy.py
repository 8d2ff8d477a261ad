"""CMA-ES whose whole state stays on one device of torch, such as a GPU.

The constants are pycma's, read from a strategy of its own, and the updates are those that it makes
with these options, so that the two differ in rounding alone. Sources: Hansen 2016, "The CMA
Evolution Strategy: A Tutorial" (equation numbers below), and pycma.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch

from ncrs.automaton.device_genomes import DeviceGenomes
from ncrs.evolution.optimizers.cholesky_sampler import CholeskySampler, check_device
from ncrs.evolution.optimizers.constants import Constants, Path, Vector
from ncrs.evolution.optimizers.step_size import PathLength
from ncrs.evolution.schema import check_like, check_names


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
        self.constants = Constants.read(template)
        self._step_size = PathLength(template)
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

    def tell(self, values: Vector) -> None:
        """Learn from the values of the population that was asked for, smaller is better."""
        assert self._z is not None
        constants = self.constants
        order = torch.from_numpy(np.argsort(values)).to(self._device)
        z = self._z[order]
        self._z = None
        self._count += 1
        weights, parents = constants.weights(len(values)), constants.parents
        positive = self._vector(weights[:parents])
        # Equations 41 and 42: recombination.
        white_shift = positive @ z[:parents].double()
        shift = self._shift(positive, white_shift)
        self._mean = self._mean + self.sigma * shift
        # Equation 43: the path of sigma, in which C^-1/2 y = z.
        gain = constants.gain * math.sqrt(constants.effective)
        self._ps = (1.0 - constants.cs) * self._ps + gain * white_shift
        squared = float(self._ps.square().sum())
        # Equations 45 to 47: the path of C, and C itself.
        path = constants.path(squared, self._count)
        self._adapt(shift, path, z, constants.cmu * weights)
        self.sigma *= self._step_size.factor_of(math.sqrt(squared))

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
