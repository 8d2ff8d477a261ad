"""CMA-ES by pycma: full, diagonal or no covariance. Source: paper section 5; Hansen 2016."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ncrs.evolution.optimizers.base import (
    Fitness,
    Genomes,
    Optimizer,
    OptimizerError,
    State,
)
from ncrs.evolution.optimizers.pycma import CMAAdaptSigmaCSA, CMAAdaptSigmaTPA, cma
from ncrs.evolution.optimizers.pycma_state import capture, restore

# "decay" keeps the path of "csa", from which pycma tells stalls, but not its step size.
STEP_SIZES = {"csa": CMAAdaptSigmaCSA, "tpa": CMAAdaptSigmaTPA, "decay": CMAAdaptSigmaCSA}
SIGMA_DECAY = 0.9975
SIGMA_MIN = 0.0015
RESTART_FROM = ("mean", "best", "elite")
LINEAR_ALGEBRA = ("torch", "pycma")
PRECISION = "float32"
DEVICE = "cpu"


class CMAES(Optimizer):
    """CMA-ES from mean 0.

    Args:
        dimension: length N of a genome.
        seed: of the optimizer's own generator.
        sigma: initial step size, 0.01 in the paper.
        population: genomes per generation, 112 in the paper.
        told_popsize: whether pycma knows the population size. If not, as in the published runs,
            its recombination uses the ``2 + 1.5 ln N`` best (14 at N = 4,572) of the population
            rather than half of it: a higher selection pressure.
        step_size: how sigma adapts: "csa" (cumulative path length, as in the paper's time) or
            "tpa" (two-point adaptation, newer pycma's choice for many dimensions); or "decay": a
            fixed schedule, which neither noise nor plateaus can collapse.
        sigma_decay: with "decay", sigma's factor per generation (default 0.9975).
        sigma_min: with "decay", where it ends (default 0.0015).
        diagonal: learn variances only (separable CMA-ES): linear instead of quadratic memory and
            faster learning rates.
        restart_sigma: below this step size the search starts anew, with ``sigma`` and nothing
            learned; None for never.
        restart_from: where it starts anew: "mean"; "best", the best genome told so far (by the
            fitness it was told with, so on new scenarios every generation it is a lucky draw); or
            "elite", the best in the archive that is attached, whose fitness can be estimated again
            (the mean while there is none).
        linear_algebra: of the full covariance: "torch", with Cholesky factors (the default), or
            "pycma", with eigenvectors.
        precision: "float32" (the default) or "float64"; with torch.
        device: "cpu" (the default) or another torch device, such as "cuda"; with torch.
    """

    name: ClassVar[str] = "cma_es"

    def __init__(
        self,
        dimension: int,
        seed: np.random.SeedSequence,
        *,
        sigma: float = 0.01,
        population: int = 112,
        told_popsize: bool = True,
        step_size: str = "csa",
        sigma_decay: float | None = None,
        sigma_min: float | None = None,
        diagonal: bool = False,
        restart_sigma: float | None = None,
        restart_from: str = "mean",
        linear_algebra: str | None = None,
        precision: str | None = None,
        device: str | None = None,
    ) -> None:
        super().__init__(dimension, seed)
        _check_positive("sigma", sigma)
        if population < 2:
            raise OptimizerError(f"population must be at least 2, got {population!r}.")
        _check_choice("step_size", step_size, STEP_SIZES)
        _check_choice("restart_from", restart_from, RESTART_FROM)
        if restart_sigma is not None:
            _check_positive("restart_sigma", restart_sigma)
            if restart_sigma >= sigma:
                raise OptimizerError(
                    f"restart_sigma must be smaller than sigma, {sigma!r}, got {restart_sigma!r}."
                )
        self._sigma0 = float(sigma)
        self._step_size = step_size
        self._schedule = _sigma_schedule(step_size, sigma, sigma_decay, sigma_min)
        least = self._schedule.get("sigma_min", 0.0)
        if restart_sigma is not None and restart_sigma <= least:
            raise OptimizerError(
                f"restart_sigma must exceed sigma_min, {least!r}, below which the schedule never "
                f"goes; got {restart_sigma!r}."
            )
        self._population = int(population)
        self._told_popsize = bool(told_popsize)
        self._diagonal = bool(diagonal)
        self._restart_sigma = None if restart_sigma is None else float(restart_sigma)
        self._restart_from = restart_from
        self._algebra = _linear_algebra(self._diagonal, linear_algebra, precision, device)
        self._restarts = 0
        self._best_genome: NDArray[np.float64] | None = None
        self._best_fitness = -math.inf
        self._es = self._make(np.zeros(dimension), self._make_sampler())
        self._unasked: State = {}
        parents = int(self._es.sp.weights.mu)
        if parents > population:
            raise OptimizerError(
                f"population {population} is smaller than the {parents} parents that pycma "
                "recombines; enlarge it, or set told_popsize=true."
            )

    def _options(self) -> dict[str, Any]:
        """pycma's options that say which covariance is learned."""
        return {"CMA_diagonal": self._diagonal}

    def _randn(self, *shape: int) -> NDArray[np.float64]:
        return self._generator.standard_normal(shape)

    def _make_sampler(self) -> Any:
        """The sampler in place of pycma's own; None to keep that."""
        if self._algebra.get("linear_algebra") != "torch":
            return None
        # Imported here so that the optimizers that need no torch do not load it.
        from ncrs.evolution.optimizers.cholesky_sampler import CholeskySampler

        precision, device = self._algebra["precision"], self._algebra["device"]
        return CholeskySampler(self.dimension, self._randn, precision, device)

    def _make(self, start: NDArray[np.float64], sampler: Any) -> Any:
        options: dict[str, Any] = {
            # pycma seeds numpy's global generator unless the seed is NaN.
            "seed": float("nan"),
            "randn": self._randn,
            "AdaptSigma": STEP_SIZES[self._step_size],
            "verbose": -9,
            "verb_disp": 0,
            "verb_log": 0,
            **self._options(),
        }
        if self._told_popsize:
            options["popsize"] = self._population
        if sampler is not None:
            options["CMA_sampler"] = sampler
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", module="cma")
            es = cma.CMAEvolutionStrategy(start, self._sigma0, options)
        if sampler is not None:
            _set_up_as_pycma_does(es, sampler)
        return es

    @property
    def settings(self) -> dict[str, Any]:
        return {
            "sigma": self._sigma0,
            "population": self._population,
            "told_popsize": self._told_popsize,
            "step_size": self._step_size,
            **self._schedule,
            "diagonal": self._diagonal,
            "restart_sigma": self._restart_sigma,
            "restart_from": self._restart_from,
            **self._algebra,
        }

    @property
    def mean(self) -> NDArray[np.float64]:
        return np.array(self._es.mean, dtype=np.float64)

    @property
    def sigma(self) -> float:
        """The current step size."""
        return float(self._es.sigma)

    def metrics(self) -> dict[str, float]:
        if self._diagonal:
            deviations = np.asarray(self._es.sigma_vec.scaling, dtype=np.float64)
            condition = float((deviations.max() / deviations.min()) ** 2)
        else:
            condition = float(self._es.condition_number)
        metrics = {"sigma": self.sigma, "condition_number": condition}
        if self._restart_sigma is not None:
            metrics["restarts"] = float(self._restarts)
        if self._algebra.get("linear_algebra") == "torch":
            metrics["covariance_repairs"] = float(self._es.sm.repairs)
        return metrics

    def _ask(self) -> Genomes:
        if self._restart_from == "elite" and self._attached is None:
            raise OptimizerError("restart_from=elite needs an archive: call attach(archive) first.")
        # Asking uses some of the state up, but of the sampler only its lazy decomposition.
        self._unasked = capture(self._es, sampler=False)
        return np.array(self._es.ask(self._population), dtype=np.float64)

    def _tell(self, asked: Genomes, fitness: Fitness, added: Any = None) -> None:
        sigma = self.sigma
        with warnings.catch_warnings():
            # Telling more than pycma's own population size is deliberate where it was not told.
            warnings.filterwarnings("ignore", message="The number of solutions passed to `tell`")
            self._es.tell(list(asked), (-fitness).tolist())
        if self._schedule:
            least, decay = self._schedule["sigma_min"], self._schedule["sigma_decay"]
            self._es.sigma = max(least, sigma * decay)
        best = int(np.argmax(fitness))
        if fitness[best] > self._best_fitness:
            self._best_genome, self._best_fitness = asked[best].copy(), float(fitness[best])
        if self._restart_sigma is not None and self.sigma < self._restart_sigma:
            self._restart()

    def _restart(self) -> None:
        start = None
        if self._restart_from == "best" and self._best_genome is not None:
            start = self._best_genome.copy()
        elif self._restart_from == "elite" and self._attached is not None:
            start = self._attached.best_genome()
        self.restart(self.mean if start is None else start)

    def start_from(self, genome: NDArray[np.float64]) -> None:
        self.restart(genome)
        self._restarts = 0

    def restart(self, start: NDArray[np.float64]) -> None:
        """Search anew around ``start``, ``(N,)``, with the first sigma and nothing learned."""
        sampler = None
        if self._algebra.get("linear_algebra") == "torch":
            sampler = self._es.sm  # its matrices are used again
            sampler.reset()
        self._es = self._make(start, sampler)
        self._restarts += 1

    def _state(self) -> State:
        state = capture(self._es)
        return {
            "es": state if self._asked is None else {**state, **self._unasked},
            "restarts": self._restarts,
            "best_genome": self._best_genome,
            "best_fitness": self._best_fitness,
        }

    def _load_state(self, state: Mapping[str, Any]) -> None:
        fresh = self._make(np.zeros(self.dimension), self._make_sampler())
        restore(fresh, state["es"])
        self._es = fresh
        self._restarts = state["restarts"]
        self._best_genome = state["best_genome"]
        self._best_fitness = state["best_fitness"]


class IsotropicCMAES(CMAES):
    """CMA-ES that adapts its mean and step size only: the control without covariance.

    Args:
        dimension: length N of a genome.
        seed: of the optimizer's own generator.
        sigma, population, told_popsize, step_size, sigma_decay, sigma_min, restart_sigma,
            restart_from: as of ``CMAES``.
    """

    name: ClassVar[str] = "iso_cma_es"

    def __init__(
        self,
        dimension: int,
        seed: np.random.SeedSequence,
        *,
        sigma: float = 0.01,
        population: int = 112,
        told_popsize: bool = True,
        step_size: str = "csa",
        sigma_decay: float | None = None,
        sigma_min: float | None = None,
        restart_sigma: float | None = None,
        restart_from: str = "mean",
    ) -> None:
        super().__init__(
            dimension,
            seed,
            sigma=sigma,
            population=population,
            told_popsize=told_popsize,
            step_size=step_size,
            sigma_decay=sigma_decay,
            sigma_min=sigma_min,
            diagonal=True,  # linear memory; that diagonal stays at one
            restart_sigma=restart_sigma,
            restart_from=restart_from,
        )

    def _options(self) -> dict[str, Any]:
        return {**super()._options(), "CMA_on": 0}


def _set_up_as_pycma_does(es: Any, sampler: Any) -> None:
    """Do for a foreign sampler what pycma does for its own only."""
    rates = sampler.parameters(mueff=es.sp.weights.mueff, lam=es.sp.weights.lambda_)
    # Without this the negative weights are too large for the covariance to stay positive definite.
    es.sp.weights.finalize_negative_weights(es.N, rates["c1"], rates["cmu"])
    sampler.lazy_update_gap = 1.0 / (es.sp.c1 + es.sp.cmu + 1e-23) / es.N / 10.0


def _sigma_schedule(
    step_size: str, sigma: float, decay: float | None, least: float | None
) -> dict[str, float]:
    """The settings of the fixed schedule with their defaults, checked; none without it."""
    if step_size != "decay":
        _refuse(
            {"sigma_decay": decay, "sigma_min": least}, f"step_size={step_size} has no schedule"
        )
        return {}
    decay = SIGMA_DECAY if decay is None else float(decay)
    least = min(SIGMA_MIN, sigma) if least is None else float(least)
    if not 0.0 < decay <= 1.0:
        raise OptimizerError(f"sigma_decay must lie in (0, 1], got {decay!r}.")
    if not 0.0 < least <= sigma:
        raise OptimizerError(f"sigma_min must be positive and at most sigma, got {least!r}.")
    return {"sigma_decay": decay, "sigma_min": least}


def _linear_algebra(
    diagonal: bool, linear_algebra: str | None, precision: str | None, device: str | None
) -> dict[str, str]:
    """The settings of the full covariance with their defaults, checked; none if diagonal."""
    given = {"linear_algebra": linear_algebra, "precision": precision, "device": device}
    if diagonal:
        _refuse(given, "A diagonal covariance has no matrices")
        return {}
    linear_algebra = linear_algebra or LINEAR_ALGEBRA[0]
    _check_choice("linear_algebra", linear_algebra, LINEAR_ALGEBRA)
    if linear_algebra == "pycma":
        _refuse(
            {"precision": precision, "device": device},
            "linear_algebra=pycma has neither",
        )
        return {"linear_algebra": linear_algebra}
    return {
        "linear_algebra": linear_algebra,
        "precision": precision or PRECISION,
        "device": device or DEVICE,
    }


def _refuse(given: Mapping[str, Any], reason: str) -> None:
    names = [name for name, value in given.items() if value is not None]
    if names:
        raise OptimizerError(f"{reason}: leave out {', '.join(names)}.")


def _check_positive(name: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0):
        raise OptimizerError(f"{name} must be positive and finite, got {value!r}.")


def _check_choice(name: str, value: str, choices: Any) -> None:
    if value not in choices:
        raise OptimizerError(f"{name} must be one of {sorted(choices)}, got {value!r}.")
