"""Engine on any executor of the shape of ``concurrent.futures``."""

from __future__ import annotations

import importlib
import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from typing import Any

from ncrs.engines.base import FUTURES_ENGINE, EngineError, EngineSettingError
from ncrs.engines.cluster.crew import Crew, Seat
from ncrs.engines.cluster.sharded import ShardedEngine, WorkerOptions
from ncrs_envs.notices import notice
from ncrs_envs.tasks import TaskSettings

MakeExecutor = Callable[..., Executor]
"""Class or function that takes ``max_workers`` by name."""


def process_pool(max_workers: int) -> Executor:
    """Make a pool of new interpreters, which inherit no locks of this process's threads."""
    return ProcessPoolExecutor(max_workers, mp_context=multiprocessing.get_context("spawn"))


class FuturesEngine(ShardedEngine):
    """``Engine`` on the workers of an executor.

    Args:
        settings: Task and its settings.
        workers: Number of workers to make the executor with; None for one per core.
        executor: Class or function that makes the executor, as MODULE:NAME or itself; None for
            processes of this computer.
        **options: Fields of ``WorkerOptions``.

    Raises:
        EngineSettingError: The executor cannot be imported, or an option is out of range.
    """

    name = FUTURES_ENGINE

    def __init__(
        self,
        settings: TaskSettings,
        workers: int | None = None,
        executor: str | MakeExecutor | None = None,
        **options: Any,
    ) -> None:
        super().__init__(settings, workers, WorkerOptions(**options))
        make = _named(executor) if isinstance(executor, str) else executor
        self._make_executor = process_pool if make is None else make

    def _make_crew(self) -> Crew:
        return ExecutorCrew(self._make_executor, self.workers, self.setup.threads or 1)


def _named(name: str) -> MakeExecutor:
    """Import the maker of an executor by its name."""
    module, _, attribute = name.partition(":")
    try:
        made: MakeExecutor = getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        raise EngineSettingError(
            f"engine.executor must name a class or function as MODULE:NAME, such as "
            f"concurrent.futures:ProcessPoolExecutor; {name!r} cannot be imported ({error})."
        ) from error
    return made


class ExecutorCrew(Crew):
    """The anonymous workers of an executor, which is made again if it breaks.

    Args:
        make: Maker of the executor.
        workers: Number of workers to make it with.
        threads: Threads of each worker.
    """

    is_anonymous = True

    def __init__(self, make: MakeExecutor, workers: int, threads: int) -> None:
        self._make, self._workers = make, workers
        self._executor = make(max_workers=workers)
        # MPI's says how many there are, whatever it was asked for.
        number = int(getattr(self._executor, "num_workers", workers) or workers)
        self._seats = [Seat(f"worker {index} of the executor", threads) for index in range(number)]

    def seats(self) -> Sequence[Seat]:
        """List as many anonymous seats as the executor has workers."""
        return self._seats

    def submit(self, seat: Seat, function: Callable[[Any], Any], argument: Any) -> Future[Any]:
        """Apply a function on any worker of the executor.

        Raises:
            EngineError: The executor is broken, and so is the one made in its place.
        """
        try:
            return self._executor.submit(function, argument)
        except BrokenExecutor as error:
            notice(f"the executor lost a worker, and is made again: {error}")
            self._executor = self._make(max_workers=self._workers)
        try:
            return self._executor.submit(function, argument)
        except BrokenExecutor as error:
            raise EngineError(f"The executor cannot be used any more: {error}") from error

    def close(self) -> None:
        """End the executor, once its workers have finished what they are at."""
        self._executor.shutdown(wait=True)
