"""Interface of the workers of a cluster, and their admission."""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, ClassVar

from ncrs.engines.base import REFUSE, WARN, EngineSettingError
from ncrs.engines.cluster.records import WorkerFacts
from ncrs.engines.cluster.station import own_versions
from ncrs.engines.pool import WorkerWarning


class WorkerLost(Exception):
    """A worker ended before it answered; the message says how."""


@dataclass(frozen=True)
class Seat:
    """A place to send a shard to: a worker, or one of as many anonymous ones."""

    name: str
    """Name of the worker, see ``WorkerFacts``; of no meaning where workers are anonymous."""
    threads: int


class Crew(ABC):
    """Workers of a cluster, which may come and go."""

    is_anonymous: ClassVar[bool] = False
    """True if nobody knows in advance which worker takes a shard."""

    @abstractmethod
    def seats(self) -> Sequence[Seat]:
        """List the workers that may be given something now.

        Raises:
            EngineError: If the cluster is lost.
        """

    @abstractmethod
    def submit(self, seat: Seat, function: Callable[[Any], Any], argument: Any) -> Future[Any]:
        """Apply a function of the package to an argument at a seat.

        The future raises ``WorkerLost`` or ``BrokenExecutor`` if the worker ends first.
        """

    @abstractmethod
    def close(self) -> None:
        """Release the workers."""


class Admission:
    """Judge of workers: all must compute alike.

    Args:
        reaction: "refuse" or "warn", the reaction to other versions.
        expected: Engine that workers are expected to use, until the first says which it does.

    Raises:
        EngineSettingError: If there is no such reaction.
    """

    def __init__(self, reaction: str, expected: str) -> None:
        if reaction not in (REFUSE, WARN):
            raise EngineSettingError(
                f"engine.other_versions must be {REFUSE} or {WARN}, got {reaction!r}."
            )
        self._reaction = reaction
        self._own = own_versions()
        self._expected = expected
        self._first: WorkerFacts | None = None
        self._seen: set[str] = set()

    @property
    def engine(self) -> str:
        """Name of the engine with which the workers evaluate."""
        return self._expected if self._first is None else self._first.engine

    def objection(self, worker: WorkerFacts) -> str | None:
        """Return a sentence that says why a worker must not take part; None if it may.

        Warns:
            WorkerWarning: A worker that was not seen before has other versions, which are not
                refused.
        """
        is_new = worker.name not in self._seen
        self._seen.add(worker.name)
        other = [
            f"{name} {worker.versions.get(name)} (here {own})"
            for name, own in self._own.items()
            if worker.versions.get(name) != own
        ]
        if other:
            text = f"The worker {worker} has {', '.join(other)}"
            if self._reaction == REFUSE:
                return (
                    f"{text}: it might compute other numbers. Install the same versions, or set "
                    f"engine.other_versions={WARN}."
                )
            if is_new:
                warnings.warn(f"{text}: numbers may differ.", WorkerWarning, stacklevel=2)
        if self._first is None:
            self._first = worker
        elif worker.engine != self._first.engine:
            return (
                f"The worker {worker} would evaluate with {worker.engine}, but {self._first} with "
                f"{self._first.engine}, whose numbers differ in the last digits. Use workers of "
                "one kind, or set engine.on_workers=batched."
            )
        return None
