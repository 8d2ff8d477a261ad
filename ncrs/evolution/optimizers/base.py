"""The interface of all optimizers, with the checks that they share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.device_genomes import AnyGenomes, DeviceGenomes
from ncrs.evolution.archive import AddResult, Archive
from ncrs.evolution.optimizers.settings import OptimizerError, OptimizerSettings
from ncrs.evolution.schema import StoredStateError, check_names

State = dict[str, Any]
"""Arrays, and values that JSON can hold: what a checkpoint stores."""

Genomes = NDArray[np.float64]
Fitness = NDArray[np.float64]


class Optimizer(ABC):
    """Proposes populations and learns from their fitness, which is maximised.

    Args:
        dimension: Length N of a genome.
        seed: Seed of the optimizer's own generator, its only source of randomness.
        settings: Record of the optimizer's settings.
    """

    candidate_source: ClassVar[str] = "mean"
    """Origin of ``mean``: "mean" of the search distribution, or the archive's best "elite"."""

    def __init__(
        self, dimension: int, seed: np.random.SeedSequence, settings: OptimizerSettings
    ) -> None:
        if dimension < 1:
            raise OptimizerError(f"dimension must be at least 1, got {dimension}.")
        self.settings = settings
        self.dimension = dimension
        self._generator = np.random.Generator(np.random.PCG64(seed))
        # The generator's state before the pending ``ask``: asking again from there gives the same
        # population.
        self._before_ask: dict[str, Any] | None = None
        self._asked: AnyGenomes | None = None
        self._attached: Archive | None = None

    def ask(self) -> Genomes:
        """Propose the next population, float64 ``(P, N)``.

        Raises:
            OptimizerError: If the fitness of the last population was not told.
        """
        return np.asarray(self.ask_in_place())

    def ask_in_place(self) -> AnyGenomes:
        """Propose the next population where the search is: on a GPU with ``device=cuda``.

        Raises:
            OptimizerError: If the fitness of the last population was not told.
        """
        if self._asked is not None:
            raise OptimizerError(
                f"ask() was called twice: first tell() the {len(self._asked)} fitness values of "
                "the population that was asked for."
            )
        self._before_ask = _plain(self._generator.bit_generator.state)
        self._asked = self._ask()
        if isinstance(self._asked, DeviceGenomes):
            return self._asked
        return self._asked.copy()  # changes to it must not change the search

    def attach(self, archive: Archive) -> None:
        """Give the optimizer the run's archive, which the caller adds to before each ``tell``.

        Raises:
            OptimizerError: If its genomes have another length.
        """
        if archive.dimension != self.dimension:
            raise OptimizerError(
                f"The archive's genomes have {archive.dimension} weights, this optimizer's "
                f"{self.dimension}."
            )
        self._attached = archive

    @property
    def name(self) -> str:
        """Name of the optimizer."""
        return self.settings.name

    def start_from(self, genome: NDArray[np.float64]) -> None:
        """Search around ``genome``, ``(N,)``, instead of around zero.

        Raises:
            OptimizerError: If this optimizer does not search around a genome.
        """
        raise OptimizerError(
            f"{self.name} cannot start from a genome; use cma_es, sep_cma_es, iso_cma_es, cma_me "
            "or cma_mae."
        )

    def tell(self, fitness: Fitness, added: AddResult | None = None) -> None:
        """Learn from the fitness of the last population.

        Args:
            fitness: One value per genome, ``(P,)``, larger is better. NaN ranks worst.
            added: Result of adding the population to the archive; only quality-diversity optimizers
                need it.

        Raises:
            OptimizerError: If no population is pending, the number of values is wrong, one of them
                is infinite, or all are NaN. The state is unchanged then.
        """
        if self._asked is None:
            raise OptimizerError("tell() was called before ask(): no population is pending.")
        given = np.asarray(fitness)
        if given.dtype.kind not in "fiub":
            raise OptimizerError(f"Fitness must be real numbers, got dtype {given.dtype}.")
        values = given.astype(np.float64)
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
        """Return all that the future depends on.

        While a population is pending, this is the state from which ``ask`` proposes it again.
        """
        generator = self._before_ask or _plain(self._generator.bit_generator.state)
        return {**self._identity(), "generator": generator, **self._state()}

    def load_state(self, state: Mapping[str, Any]) -> None:
        """Continue from a ``state``.

        Raises:
            OptimizerError: If the state has another optimizer, size or setting, is incomplete, or
                malformed. Nothing is changed then, unless a matrix of the covariance was.
        """
        for key, value in self._identity().items():
            stored = state.get(key)
            if key == "settings" and isinstance(stored, Mapping):
                # A setting that is newer than the state was at what is now its default.
                stored = {**{item.name: item.default for item in fields(self.settings)}, **stored}
            if stored != value:
                raise OptimizerError(
                    f"Cannot continue: the state's {key} is {stored!r}, this optimizer's is "
                    f"{value!r}."
                )
        try:
            check_names(state, self.state(), "The optimizer's state", ())
            generator = np.random.PCG64()
            generator.state = state["generator"]
            self._load_state(state)
        except (StoredStateError, KeyError, TypeError, ValueError) as error:
            raise OptimizerError(f"Cannot continue: {error}") from error
        self._generator.bit_generator.state = state["generator"]
        self._asked = None
        self._before_ask = None

    def _identity(self) -> State:
        """Return the entries that must agree for a state to be loaded, as JSON values."""
        return {
            "optimizer": self.name,
            "dimension": self.dimension,
            "settings": asdict(self.settings),
        }

    @property
    @abstractmethod
    def mean(self) -> NDArray[np.float64]:
        """Mean of the search distribution, ``(N,)``: a candidate of its own, often the best."""

    @abstractmethod
    def metrics(self) -> dict[str, float]:
        """Return values to plot, such as sigma and the condition number."""

    @abstractmethod
    def _ask(self) -> AnyGenomes: ...

    @abstractmethod
    def _tell(self, asked: AnyGenomes, fitness: Fitness, added: AddResult | None) -> None: ...

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
    """Convert a bit generator's state to JSON values."""
    if isinstance(state, Mapping):
        return {key: _plain(value) for key, value in state.items()}
    return state.item() if isinstance(state, np.generic) else state
