"""CMA-ES with a full, a diagonal or no covariance. Source: paper section 5; Hansen 2016.

pycma searches with a full one, and sets the constants of all.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.device_genomes import AnyGenomes, DeviceGenomes
from ncrs.evolution.optimizers.base import Fitness, Optimizer, State
from ncrs.evolution.optimizers.pycma import CMAAdaptSigmaCSA, CMAAdaptSigmaTPA, cma
from ncrs.evolution.optimizers.pycma_state import capture, restore
from ncrs.evolution.optimizers.separable_strategy import SeparableStrategy
from ncrs.evolution.optimizers.settings import MatrixSettings, OptimizerError, SearchSettings
from ncrs.evolution.schema import check_like

# "decay" keeps the path of "csa", from which pycma detects stalls, but not its step size.
_STEP_SIZES = {"csa": CMAAdaptSigmaCSA, "tpa": CMAAdaptSigmaTPA, "decay": CMAAdaptSigmaCSA}


class CMAES(Optimizer):
    """CMA-ES from mean 0.

    Args:
        dimension: Length N of a genome.
        seed: Seed of the optimizer's own generator.
        settings: Record of the optimizer's settings.
    """

    settings: SearchSettings

    def __init__(
        self, dimension: int, seed: np.random.SeedSequence, settings: SearchSettings
    ) -> None:
        super().__init__(dimension, seed, settings)
        self._matrices: MatrixSettings | None = None  # torch's, in place of pycma's own
        if isinstance(settings, MatrixSettings) and settings.linear_algebra == "torch":
            self._matrices = settings
        self._restarts = 0
        self._best_genome: NDArray[np.float64] | None = None
        self._best_fitness = -math.inf
        self._es = self._make(np.zeros(dimension), self._make_sampler())
        self._unasked: State = {}

    def _randn(self, *shape: int) -> NDArray[np.float64]:
        return self._generator.standard_normal(shape)

    def _make_sampler(self) -> Any:
        """Make the sampler that replaces pycma's own; None to keep pycma's."""
        if self._matrices is None:
            return None
        # Imported here so that the optimizers that need no torch do not load it.
        from ncrs.evolution.optimizers.cholesky_sampler import CholeskySampler

        precision, device = self._matrices.precision, self.settings.device
        return CholeskySampler(self.dimension, self._randn, precision, device)

    def _make_pycma(self, start: NDArray[np.float64], sampler: Any) -> Any:
        settings = self.settings
        # pycma recombines half of its popsize; ``_ask`` requests the real population.
        popsize = settings.population if settings.parents is None else 2 * settings.parents + 1
        options: dict[str, Any] = {
            # pycma seeds numpy's global generator unless the seed is NaN.
            "seed": float("nan"),
            "randn": self._randn,
            "popsize": popsize,
            "AdaptSigma": _STEP_SIZES[settings.step_size],
            # Without a covariance, a diagonal one in linear memory stays at one.
            "CMA_diagonal": settings.covariance != "full",
            "verbose": -9,
            "verb_disp": 0,
            "verb_log": 0,
        }
        if settings.covariance == "none":
            options["CMA_on"] = 0
        if sampler is not None:
            options["CMA_sampler"] = sampler
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", module="cma")
            es = cma.CMAEvolutionStrategy(start, settings.sigma, options)
        if sampler is not None:
            _set_up_as_pycma_does(es, sampler)
        return es

    def _make(self, start: NDArray[np.float64], sampler: Any) -> Any:
        """Make the strategy: pycma's, or one that takes its constants from it."""
        settings, es = self.settings, self._make_pycma(start, sampler)
        if settings.device == "cpu":
            # pycma alone adds mirror images to a popsize below 6.
            if settings.covariance == "full" or es.sp.lam_mirr:
                return es
            return SeparableStrategy(es, start, self._generator)
        from ncrs.evolution.optimizers.device_strategy import DiagonalStrategy, FullStrategy

        seed = int(self._generator.integers(2**63))
        if sampler is not None:
            return FullStrategy(es, sampler, start, seed)
        return DiagonalStrategy(es, settings.device, start, seed)

    @property
    def mean(self) -> NDArray[np.float64]:
        """Mean of the search distribution, ``(N,)``."""
        return np.array(self._es.mean, dtype=np.float64)

    @property
    def sigma(self) -> float:
        """Current step size."""
        return float(self._es.sigma)

    def metrics(self) -> dict[str, float]:
        """Return sigma and condition number, and the counts of restarts and repairs in use."""
        is_pycma = isinstance(self._es, cma.CMAEvolutionStrategy)
        if is_pycma and self.settings.covariance != "full":
            deviations = np.asarray(self._es.sigma_vec.scaling, dtype=np.float64)
            condition = float((deviations.max() / deviations.min()) ** 2)
        else:
            condition = float(self._es.condition_number)
        metrics = {"sigma": self.sigma, "condition_number": condition}
        if self.settings.restart_sigma is not None:
            metrics["restarts"] = float(self._restarts)
        if self._matrices is not None:
            metrics["covariance_repairs"] = float(self._es.sm.repairs)
        return metrics

    def _ask(self) -> AnyGenomes:
        if self.settings.restart_from == "elite" and self._attached is None:
            raise OptimizerError("restart_from=elite needs an archive: call attach(archive) first.")
        # Asking changes part of the state, but of the sampler only its lazy decomposition.
        self._unasked = self._capture(sampler=False)
        asked: AnyGenomes = self._es.ask(self.settings.population)
        if isinstance(asked, DeviceGenomes):
            return asked
        return np.asarray(asked, dtype=np.float64)

    def _tell(self, asked: AnyGenomes, fitness: Fitness, added: Any = None) -> None:
        sigma = self.sigma
        if isinstance(self._es, cma.CMAEvolutionStrategy):
            with warnings.catch_warnings():
                # Telling another number than pycma's popsize is deliberate, see ``parents``.
                message = "The number of solutions passed to `tell`"
                warnings.filterwarnings("ignore", message=message)
                self._es.tell(list(np.asarray(asked)), (-fitness).tolist())
        else:
            self._es.tell(-fitness)
        schedule, restart_sigma = self.settings.schedule, self.settings.restart_sigma
        if schedule is not None:
            self._es.sigma = max(schedule.minimum, sigma * schedule.decay)
        best = int(np.argmax(fitness))
        if fitness[best] > self._best_fitness:
            self._best_genome, self._best_fitness = asked[best].copy(), float(fitness[best])
        if restart_sigma is not None and self.sigma < restart_sigma:
            self._restart()

    def _restart(self) -> None:
        start, source = None, self.settings.restart_from
        if source == "best" and self._best_genome is not None:
            start = self._best_genome.copy()
        elif source == "elite" and self._attached is not None:
            start = self._attached.best_genome()
        self.restart(self.mean if start is None else start)

    def start_from(self, genome: NDArray[np.float64]) -> None:
        """Search around ``genome``, ``(N,)``."""
        self.restart(genome)
        self._restarts = 0

    def restart(self, start: NDArray[np.float64]) -> None:
        """Search again around ``start``, ``(N,)``, with the first sigma and nothing learned."""
        sampler = None
        if self._matrices is not None:
            sampler = self._es.sm  # reuses its matrices
            sampler.reset()
        self._es = self._make(start, sampler)
        self._restarts += 1

    def _capture(self, *, sampler: bool = True) -> State:
        """Copy the strategy's state, with or without what asking does not change."""
        if isinstance(self._es, cma.CMAEvolutionStrategy):
            return capture(self._es, sampler=sampler)
        state: State = self._es.state() if sampler else self._es.unasked()
        return state

    def _state(self) -> State:
        state = self._capture()
        return {
            "es": state if self._asked is None else {**state, **self._unasked},
            "restarts": self._restarts,
            "best_genome": self._best_genome,
            "best_fitness": self._best_fitness,
        }

    def _load_state(self, state: Mapping[str, Any]) -> None:
        fresh = self._make(np.zeros(self.dimension), self._make_sampler())
        if isinstance(fresh, cma.CMAEvolutionStrategy):
            restore(fresh, state["es"])
        else:
            fresh.load_state(state["es"])
        check_like(state["restarts"], 0, "restarts")
        if state["best_genome"] is not None:
            check_like(state["best_genome"], np.zeros(self.dimension), "best_genome")
        check_like(state["best_fitness"], 0.0, "best_fitness", may_be_infinite=True)
        self._es = fresh
        self._restarts = state["restarts"]
        self._best_genome = state["best_genome"]
        self._best_fitness = state["best_fitness"]


def _set_up_as_pycma_does(es: Any, sampler: Any) -> None:
    """Set up a foreign sampler as pycma sets up only its own."""
    rates = sampler.parameters(mueff=es.sp.weights.mueff, lam=es.sp.weights.lambda_)
    # Without this the negative weights are too large for the covariance to stay positive definite.
    es.sp.weights.finalize_negative_weights(es.N, rates["c1"], rates["cmu"])
    sampler.lazy_update_gap = 1.0 / (es.sp.c1 + es.sp.cmu + 1e-23) / es.N / 10.0
