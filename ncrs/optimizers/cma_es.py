"""CMA-ES by pycma: full or diagonal covariance. Source: paper section 5; Hansen 2016."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ncrs.optimizers.base import Fitness, Genomes, Optimizer, OptimizerError, State
from ncrs.optimizers.pycma_state import capture, restore

with warnings.catch_warnings():
    # pycma warns on import about plotting packages that only its own figures need.
    warnings.simplefilter("ignore")
    import cma
    from cma.sigma_adaptation import CMAAdaptSigmaCSA, CMAAdaptSigmaTPA

STEP_SIZES = {"csa": CMAAdaptSigmaCSA, "tpa": CMAAdaptSigmaTPA}


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
            "tpa" (two-point adaptation, newer pycma's choice for many dimensions).
        diagonal: learn variances only (separable CMA-ES): linear instead of quadratic memory and
            faster learning rates.
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
        diagonal: bool = False,
    ) -> None:
        super().__init__(dimension, seed)
        if not (math.isfinite(sigma) and sigma > 0):
            raise OptimizerError(f"sigma must be positive and finite, got {sigma!r}.")
        if population < 2:
            raise OptimizerError(f"population must be at least 2, got {population!r}.")
        if step_size not in STEP_SIZES:
            raise OptimizerError(
                f"step_size must be one of {sorted(STEP_SIZES)}, got {step_size!r}."
            )
        self._sigma0 = float(sigma)
        self._step_size = step_size
        self._population = int(population)
        self._told_popsize = bool(told_popsize)
        self._diagonal = bool(diagonal)
        self._es = self._make()
        self._unasked: State = {}
        parents = int(self._es.sp.weights.mu)
        if parents > population:
            raise OptimizerError(
                f"population {population} is smaller than the {parents} parents that pycma "
                "recombines; enlarge it, or set told_popsize=true."
            )

    def _make(self) -> Any:
        options: dict[str, Any] = {
            # pycma seeds numpy's global generator unless the seed is NaN.
            "seed": float("nan"),
            "randn": lambda *shape: self._generator.standard_normal(shape),
            "CMA_diagonal": self._diagonal,
            "AdaptSigma": STEP_SIZES[self._step_size],
            "verbose": -9,
            "verb_disp": 0,
            "verb_log": 0,
        }
        if self._told_popsize:
            options["popsize"] = self._population
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", module="cma")
            return cma.CMAEvolutionStrategy(np.zeros(self.dimension), self._sigma0, options)

    @property
    def settings(self) -> dict[str, Any]:
        return {
            "sigma": self._sigma0,
            "population": self._population,
            "told_popsize": self._told_popsize,
            "step_size": self._step_size,
            "diagonal": self._diagonal,
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
        return {"sigma": self.sigma, "condition_number": condition}

    def _ask(self) -> Genomes:
        # Asking uses some of the state up, but of the sampler only its lazy decomposition.
        self._unasked = capture(self._es, sampler=False)
        return np.array(self._es.ask(self._population), dtype=np.float64)

    def _tell(self, asked: Genomes, fitness: Fitness) -> None:
        with warnings.catch_warnings():
            # Telling more than pycma's own population size is deliberate where it was not told.
            warnings.filterwarnings("ignore", message="The number of solutions passed to `tell`")
            self._es.tell(list(asked), (-fitness).tolist())

    def _state(self) -> State:
        state = capture(self._es)
        return {"es": state if self._asked is None else {**state, **self._unasked}}

    def _load_state(self, state: Mapping[str, Any]) -> None:
        fresh = self._make()
        restore(fresh, state["es"])
        self._es = fresh
