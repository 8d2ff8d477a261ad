"""A full-covariance sampler for pycma that factorises with Cholesky instead of eigenvectors.

pycma's own sampler decomposes ``C = B D^2 B^T``, some 20 times the work of ``C = L L^T``. Sampling
needs any root of C, and so do Mahalanobis norms. Only the step-size path depends on the choice of
root: it adds up whitened steps ``L^-1 (m' - m)``, and L turns a little against the symmetric root
whenever it is renewed. Krause, Arbonès and Igel (2016) found this harmless, and
``benchmarks.optimizers`` compares the evaluations to target with plain pycma.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from ncrs.evolution.optimizers.pycma import StatisticalModelSamplerWithZeroMeanBaseClass
from ncrs.evolution.optimizers.settings import PRECISIONS, OptimizerError
from ncrs.evolution.schema import check_like, check_names

_DTYPES: Mapping[str, torch.dtype] = {name: getattr(torch, name) for name in PRECISIONS}

Vector = NDArray[np.float64]

_BLOCK = 512
"""Columns per operation where only a lower triangle is needed."""
_POWER_STEPS = 2
_FIRST_JITTER = 4.0
"""First addition to the diagonal, in rounding units times the mean variance; each further attempt
adds ten times more."""
_MAX_ATTEMPTS = 12
_FACTORS_PER_ESTIMATE = 16
"""On a GPU, factorisations per step of the condition number's estimate, which take as long."""
_FROM_CHAMPION = "from this one's champion if it has one (start_from)."


def check_device(device: str) -> None:
    """Raise ``OptimizerError`` unless torch can reach that device."""
    try:
        float(torch.ones(1, device=device).sum())  # some devices hold no values
    except (RuntimeError, AssertionError) as error:  # torch asserts that it was built with CUDA
        reason = str(error).splitlines()[0]
        raise OptimizerError(
            f"torch cannot use device {device!r} ({reason}); choose cpu, or cuda where there is a "
            "GPU that torch was built for."
        ) from error


class CholeskySampler(StatisticalModelSamplerWithZeroMeanBaseClass):  # type: ignore[misc]
    """Zero-mean normal distribution that learns its covariance, at first the identity.

    Vectors are float64 numpy arrays; the two N x N matrices are torch's, on ``device`` in
    ``precision``. Of C only the lower triangle is kept up to date.

    Args:
        dimension: Length N of a sample.
        randn: Function that draws standard normal numbers in the shape of its arguments.
        precision: Precision of the matrices, "float32" or "float64".
        device: Device of torch, such as "cpu" or "cuda".

    Raises:
        OptimizerError: If torch cannot use the device.
    """

    def __init__(
        self,
        dimension: int,
        randn: Callable[..., Vector],
        precision: str = "float32",
        device: str = "cpu",
    ) -> None:
        check_device(device)
        self.dimension = dimension
        self.randn = randn
        self.lazy_update_gap = 0.0
        self._dtype = _DTYPES[precision]
        self._device = torch.device(device)
        self._c = torch.eye(dimension, dtype=self._dtype, device=self._device)
        # In column-major order, as LAPACK writes it: no second copy while it factorises.
        self._l = torch.eye(dimension, dtype=self._dtype, device=self._device).mT
        self._info = torch.zeros((), dtype=torch.int32, device=self._device)
        self.reset()

    def reset(self) -> None:
        """Return to the identity; ``randn`` and ``lazy_update_gap`` stay."""
        for matrix in (self._c, self._l):
            matrix.zero_()
            matrix.diagonal().fill_(1.0)
        self.count_tell = 0
        self.last_update = 0
        self.repairs = 0
        self._factors = 0
        start = np.random.Generator(np.random.PCG64(0)).standard_normal(self.dimension)
        self._extremes = self._tensor(np.stack([start, start], axis=1))
        self._condition = 1.0

    @property
    def device(self) -> torch.device:
        """Device of the matrices."""
        return self._device

    @property
    def dtype(self) -> torch.dtype:
        """Type of the matrices."""
        return self._dtype

    # The interface that pycma calls.

    def sample(self, number: int) -> Vector:
        """Draw ``(number, N)`` samples, after renewing the factor if that is due."""
        self.update_now()
        z = self._tensor(self.randn(number, self.dimension))
        return self._array(self.times_factor(z))

    def update(self, vectors: Any, weights: Any) -> None:
        """Learn from ``(K, N)`` steps: ``C <- (1 - sum w) C + sum w_k y_k y_k^T``.

        Args:
            vectors: Steps y, in units of sigma.
            weights: K learning rates. Steps with a negative rate are first scaled to the
                Mahalanobis length sqrt(N), which keeps C positive definite (Hansen 2016, eq. 46).
        """
        weights = np.array(weights, dtype=np.float64)
        decay = 1.0 - weights.sum()
        used = np.flatnonzero(weights)
        weights = weights[used]
        y = self._tensor(np.stack([vectors[k] for k in used]))
        negative = np.flatnonzero(weights < 0)
        if len(negative):
            norms = self._whiten(y[torch.from_numpy(negative)].mT).norm(dim=0)
            weights[negative] *= self.dimension / (self._array(norms) + 1e-9) ** 2
        self._add_products(y, weights, decay)

    def learn(self, vectors: torch.Tensor, weights: Vector, norms: torch.Tensor) -> None:
        """Learn as ``update`` does from steps whose Mahalanobis lengths are known.

        Args:
            vectors: Steps y on this device, ``(K, N)``, in units of sigma.
            weights: K learning rates.
            norms: Mahalanobis length of each step; used where the learning rate is negative.
        """
        weights = weights.copy()
        decay = 1.0 - weights.sum()
        negative = weights < 0
        weights[negative] *= self.dimension / (self._array(norms)[negative] + 1e-9) ** 2
        self._add_products(vectors, weights, decay)

    def _add_products(self, y: torch.Tensor, weights: Vector, decay: float) -> None:
        """Compute ``C <- decay C + sum w_k y_k y_k^T``."""
        left = (self._tensor(weights)[:, None] * y).mT
        for start in range(0, self.dimension, _BLOCK):
            columns = slice(start, start + _BLOCK)
            self._c[start:, columns].addmm_(left[start:], y[:, columns], beta=decay)
        self.count_tell += 1

    def update_now(self, lazy_update_gap: float | None = None) -> None:
        """Renew the factor if ``lazy_update_gap`` updates have passed since the last time."""
        gap = self.lazy_update_gap if lazy_update_gap is None else lazy_update_gap
        passed = self.count_tell - self.last_update
        if passed < gap or passed == gap == 0:
            return
        self._factorise()
        self.last_update = self.count_tell
        self._factors += 1
        if self._device.type == "cpu" or self._factors % _FACTORS_PER_ESTIMATE == 0:
            self._estimate_condition()

    def transform(self, x: Vector) -> Vector:
        """Compute ``L x`` of one vector ``(N,)``."""
        return self._array(self._l @ self._tensor(x))

    def transform_inverse(self, x: Vector) -> Vector:
        """Compute ``L^-1 x`` of one vector ``(N,)``: white if x is a sample."""
        return self._array(self._whiten(self._tensor(x)[:, None])[:, 0])

    def norm(self, x: Vector) -> float:
        """Compute the Mahalanobis length of one vector ``(N,)``."""
        return float(np.linalg.norm(self.transform_inverse(x)))

    def __imul__(self, factor: float) -> CholeskySampler:
        """Multiply the covariance by a number."""
        self._c *= factor
        self._l *= math.sqrt(factor)
        return self

    @property
    def variances(self) -> Vector:
        """Variance of each coordinate, ``(N,)``."""
        return self._array(self._c.diagonal())

    @property
    def condition_number(self) -> float:
        """Ratio of the extreme eigenvalues of C as last factorised: an estimate from below.

        Each factorisation continues the power iteration for both by two steps, so that the estimate
        follows a C that changes slowly.
        """
        return self._condition

    @property
    def covariance_matrix(self) -> None:
        """None: pycma would keep copies, and decompose them. See ``covariance``."""
        return None

    # The rest of the interface.

    def covariance(self) -> Vector:
        """Return a copy of C, ``(N, N)``."""
        lower = self._c.tril()
        return self._array(lower + lower.tril(-1).mT)

    def inverse(self) -> Vector:
        """Compute the inverse of C as last factorised, ``(N, N)``."""
        return self._array(torch.cholesky_inverse(self._l))

    def state(self) -> dict[str, Any]:
        """Return arrays and JSON values from which ``load_state`` continues bit for bit.

        C and L share one matrix: C below and on the diagonal, L above it and in ``diagonal``.
        """
        index = torch.arange(self.dimension, device=self._device)
        packed = torch.where(index[:, None] >= index, self._c, self._l.mT)
        return {
            "packed": packed.cpu().numpy(),
            "diagonal": self._l.diagonal().cpu().numpy().copy(),
            "extremes": self._extremes.cpu().numpy().copy(),
            "condition": self._condition,
            "lazy_update_gap": float(self.lazy_update_gap),
            "count_tell": self.count_tell,
            "last_update": self.last_update,
            "repairs": self.repairs,
            "factors": self._factors,
        }

    def load_state(self, state: Mapping[str, Any]) -> None:
        """Continue from a ``state``; raise ``StoredStateError`` if it is incomplete or foreign."""
        kind = self._l[:0, :0].cpu().numpy().dtype
        size = self.dimension
        reference = {
            "packed": np.broadcast_to(np.zeros((), kind), (size, size)),
            "diagonal": np.zeros(size, kind),
            "extremes": self._extremes.cpu().numpy(),
            **dict.fromkeys(("condition", "lazy_update_gap"), 1.0),
            **dict.fromkeys(("count_tell", "last_update", "repairs", "factors"), 0),
        }
        check_names(state, reference, "The state of the covariance", ())
        for name, value in state.items():
            check_like(value, reference[name], f"covariance.{name}")
        packed = torch.from_numpy(state["packed"]).to(self._device)
        self._c.copy_(packed).tril_()
        self._l.copy_(packed.triu(1).mT)
        self._l.diagonal().copy_(torch.from_numpy(state["diagonal"]))
        self._extremes = self._tensor(state["extremes"])
        self._condition = state["condition"]
        self.lazy_update_gap = state["lazy_update_gap"]
        self.count_tell = state["count_tell"]
        self.last_update = state["last_update"]
        self.repairs = state["repairs"]
        self._factors = state["factors"]

    def _tensor(self, values: NDArray[Any]) -> torch.Tensor:
        # Always a copy: torch aligns its memory, and sums in another alignment round differently.
        return torch.tensor(values, dtype=self._dtype, device=self._device)

    def _array(self, values: torch.Tensor) -> Vector:
        return values.to("cpu", torch.float64, copy=True).numpy()

    def times_factor(self, z: torch.Tensor) -> torch.Tensor:
        """Compute ``L z`` for each row of ``(K, N)``."""
        y = torch.zeros_like(z)
        for start in range(0, self.dimension, _BLOCK):
            columns = slice(start, start + _BLOCK)
            y[:, start:].addmm_(z[:, columns], self._l[start:, columns].mT)
        return y

    def _whiten(self, x: torch.Tensor) -> torch.Tensor:
        """Compute ``L^-1 x`` for each column of ``(N, K)``."""
        whitened: torch.Tensor = torch.linalg.solve_triangular(self._l, x, upper=False)
        return whitened

    def _factorise(self) -> None:
        """Renew L; where C is not positive definite, add to its diagonal until it is.

        Raises:
            OptimizerError: If that is not possible. C is unchanged then; L is lost, and not used
                before it is renewed.
        """
        before = self._c.diagonal().clone()
        mean = float(before.mean())
        if not math.isfinite(mean) or mean <= 0:
            raise OptimizerError(
                f"The covariance's mean variance is {mean}: the search has diverged. Start a new "
                f"one with a smaller sigma, {_FROM_CHAMPION}"
            )
        repairs = self.repairs
        jitter = _FIRST_JITTER * torch.finfo(self._dtype).eps * mean
        for _ in range(_MAX_ATTEMPTS):
            torch.linalg.cholesky_ex(self._c, out=(self._l, self._info))
            if int(self._info) == 0:
                return
            self._c.diagonal().add_(jitter)
            self.repairs += 1
            jitter *= 10.0
        self._c.diagonal().copy_(before)
        self.repairs = repairs
        raise OptimizerError(
            f"The covariance could not be made positive definite in {_MAX_ATTEMPTS} attempts. "
            f"Start a new search with precision=float64, {_FROM_CHAMPION} With restart_sigma the "
            "search would have restarted before this point."
        )

    def _estimate_condition(self) -> None:
        large, small = self._extremes[:, :1].clone(), self._extremes[:, 1:].clone()
        for _ in range(_POWER_STEPS):
            large = self._l @ (self._l.mT @ large)
            max_eigenvalue = large.norm()
            large /= max_eigenvalue
            small = torch.linalg.solve_triangular(self._l.mT, self._whiten(small), upper=True)
            inverse_of_min = small.norm()
            small /= inverse_of_min
        self._extremes = torch.cat([large, small], dim=1)
        condition = float(max_eigenvalue * inverse_of_min)
        self._condition = condition if math.isnan(condition) else max(1.0, condition)
