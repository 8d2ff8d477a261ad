"""What every optimizer does, with the checks that they share."""

from __future__ import annotations

import importlib
import inspect
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ncrs.evolution.archive import AddResult, Archive
from ncrs_envs.errors import NCRSError

State = dict[str, Any]
"""Arrays, and values that JSON can hold: what a checkpoint stores."""

Genomes = NDArray[np.float64]
Fitness = NDArray[np.float64]


class OptimizerError(NCRSError, ValueError):
    """A setting out of range, or ask, tell and state used in a way that cannot be meant."""


class Optimizer(ABC):
    """Proposes populations and learns from their fitness, which is maximised.

    Args:
        dimension: length N of a genome.
        seed: of the optimizer's own generator, its only source of randomness.
    """

    name: ClassVar[str]
    candidate_source: ClassVar[str] = "mean"
    """What ``mean`` is: the search distribution's "mean", or the archive's best "elite"."""

    def __init__(self, dimension: int, seed: np.random.SeedSequence) -> None:
        if dimension < 1:
            raise OptimizerError(f"dimension must be at least 1, got {dimension}.")
        self.dimension = dimension
        self._generator = np.random.Generator(np.random.PCG64(seed))
        # The generator as it was before a population was asked for that has not been told: from
        # there asking again gives the same population.
        self._before_ask: dict[str, Any] | None = None
        self._asked: Genomes | None = None
        self._attached: Archive | None = None

    def ask(self) -> Genomes:
        """The next population, float64 ``(P, N)``; asking again before telling is an error."""
        if self._asked is not None:
            raise OptimizerError(
                f"ask() was called twice: first tell() the {len(self._asked)} fitness values of "
                "the population that was asked for."
            )
        self._before_ask = _plain(self._generator.bit_generator.state)
        self._asked = self._ask()
        return self._asked

    def attach(self, archive: Archive) -> None:
        """Give the optimizer the run's archive, which the caller adds to before each ``tell``.

        Raises:
            OptimizerError: its genomes have another length.
        """
        if archive.dimension != self.dimension:
            raise OptimizerError(
                f"The archive's genomes have {archive.dimension} weights, this optimizer's "
                f"{self.dimension}."
            )
        self._attached = archive

    @property
    def maximises_fitness(self) -> bool:
        """Whether it learns from the fitness that it is told, rather than from the archive."""
        return True

    def start_from(self, genome: NDArray[np.float64]) -> None:
        """Search around ``genome``, ``(N,)``, instead of around zero.

        Raises:
            OptimizerError: this optimizer cannot.
        """
        raise OptimizerError(
            f"{self.name} cannot start from a genome; use cma_es, sep_cma_es, iso_cma_es, cma_me "
            "or cma_mae."
        )

    def tell(self, fitness: Fitness, added: AddResult | None = None) -> None:
        """Learn from the fitness of the last population.

        Args:
            fitness: one value per genome, shape ``(P,)``, larger is better. NaN ranks worst.
            added: what adding the population to the archive did; only quality-diversity optimizers
                need it.

        Raises:
            OptimizerError: nothing was asked, another number of values, an infinite value, or
                nothing but NaN. The state is untouched.
        """
        if self._asked is None:
            raise OptimizerError("tell() was called before ask(): there is no population to judge.")
        values = np.asarray(fitness, dtype=np.float64)
        if values.shape != (len(self._asked),):
            raise OptimizerError(
                f"tell() needs {len(self._asked)} fitness values, one per genome asked for, "
                f"got shape {values.shape}."
            )
        if np.isinf(values).any():
            raise OptimizerError(
                f"Fitness must not be infinite; it is for genomes "
                f"{np.flatnonzero(np.isinf(values)).tolist()}."
            )
        if np.isnan(values).all():
            raise OptimizerError(f"All {len(values)} fitness values are NaN.")
        asked, self._asked, self._before_ask = self._asked, None, None
        self._tell(asked, _rank_nan_worst(values), added)

    def state(self) -> State:
        """All that the future depends on. With a population pending, the state from which ``ask``
        proposes that population again."""
        generator = self._before_ask or _plain(self._generator.bit_generator.state)
        return {
            "optimizer": self.name,
            "dimension": self.dimension,
            "settings": self.settings,
            "generator": generator,
            **self._state(),
        }

    def load_state(self, state: Mapping[str, Any]) -> None:
        """Continue from a ``state``.

        Raises:
            OptimizerError: the state is of another optimizer, size or setting; nothing is changed.
        """
        own = {"optimizer": self.name, "dimension": self.dimension, "settings": self.settings}
        for key, value in own.items():
            if state.get(key) != value:
                raise OptimizerError(
                    f"Cannot continue: the state's {key} is {state.get(key)!r}, this optimizer's "
                    f"is {value!r}."
                )
        self._load_state(state)
        self._generator.bit_generator.state = state["generator"]
        self._asked = None
        self._before_ask = None

    @property
    @abstractmethod
    def settings(self) -> dict[str, Any]:
        """The settings that must agree for a state to be loaded, as JSON can hold them."""

    @property
    @abstractmethod
    def mean(self) -> NDArray[np.float64]:
        """The search distribution's mean, ``(N,)``: a candidate of its own, often the best."""

    @abstractmethod
    def metrics(self) -> dict[str, float]:
        """Numbers worth a curve, such as sigma and the condition number."""

    @abstractmethod
    def _ask(self) -> Genomes: ...

    @abstractmethod
    def _tell(self, asked: Genomes, fitness: Fitness, added: AddResult | None) -> None: ...

    @abstractmethod
    def _state(self) -> State: ...

    @abstractmethod
    def _load_state(self, state: Mapping[str, Any]) -> None: ...


def _rank_nan_worst(fitness: Fitness) -> Fitness:
    nan = np.isnan(fitness)
    if not nan.any():
        return fitness
    return np.where(nan, np.nanmin(fitness) - 1.0, fitness)


def _plain(state: Any) -> Any:
    """A bit generator's state as JSON can hold it."""
    if isinstance(state, Mapping):
        return {key: _plain(value) for key, value in state.items()}
    return state.item() if isinstance(state, np.generic) else state


_TRIAL_DIMENSION = 100

# Module and class of each optimizer, and the settings that its name stands for.
OPTIMIZERS: Mapping[str, tuple[str, str, Mapping[str, Any]]] = {
    "cma_es": ("ncrs.evolution.optimizers.cma_es", "CMAES", {"diagonal": False}),
    "sep_cma_es": ("ncrs.evolution.optimizers.cma_es", "CMAES", {"diagonal": True}),
    "iso_cma_es": ("ncrs.evolution.optimizers.cma_es", "IsotropicCMAES", {}),
    "cma_me": ("ncrs.evolution.optimizers.cma_me", "CMAME", {}),
    "cma_mae": ("ncrs.evolution.optimizers.cma_mae", "CMAMAE", {}),
    "map_elites": ("ncrs.evolution.optimizers.map_elites", "MAPElites", {}),
}


def _optimizer_class(name: str) -> type[Optimizer]:
    if name not in OPTIMIZERS:
        raise OptimizerError(f"Unknown optimizer {name!r}; choose one of {sorted(OPTIMIZERS)}.")
    module, attribute, _ = OPTIMIZERS[name]
    cls: type[Optimizer] = getattr(importlib.import_module(module), attribute)
    return cls


def check_settings(name: str, settings: Mapping[str, Any]) -> Optimizer:
    """Raise ``OptimizerError`` unless there is such an optimizer and its settings are in range.

    The range is checked by making a small one, which is returned.
    """
    known = inspect.signature(_optimizer_class(name)).parameters.values()
    fixed = OPTIMIZERS[name][2]
    names = [p.name for p in known if p.kind is p.KEYWORD_ONLY and p.name not in fixed]
    unknown = sorted(set(settings) - set(names))
    if unknown:
        raise OptimizerError(f"{name} has no setting {', '.join(unknown)}; it has {names}.")
    return make_optimizer(name, _TRIAL_DIMENSION, np.random.SeedSequence(0), **settings)


def make_optimizer(
    name: str, dimension: int, seed: np.random.SeedSequence, **settings: Any
) -> Optimizer:
    """Make the optimizer of that name; ``OptimizerError`` if unknown, or for a bad setting."""
    cls = _optimizer_class(name)
    return cls(dimension, seed, **OPTIMIZERS[name][2], **settings)
