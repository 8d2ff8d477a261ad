"""State of one population while a crew evaluates it."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field

from ncrs.engines.base import RolloutResult
from ncrs.engines.cluster.crew import Seat
from ncrs.engines.cluster.cutting import shard_size
from ncrs.engines.cluster.records import ShardReply, WorkerFacts, joined

_LAST = 0.1
"""Part of a population that idle workers evaluate a second time, since they have nothing else."""


@dataclass(eq=False)
class Piece:
    """Consecutive genomes that are sent as one shard."""

    first: int
    last: int
    """Index after the last genome."""
    check_of: Piece | None = None
    """Evaluated piece that holds these genomes, if this is a check of its results."""
    flights: list[Flight] = field(default_factory=list)
    """Where the piece is now."""
    failures: int = 0
    """Number of workers that were lost with it, or that declined it."""
    result: RolloutResult | None = None
    worker: WorkerFacts | None = None
    """Worker that the result is from."""

    @property
    def not_on(self) -> str:
        """Name of the worker that must not evaluate it; empty if any may."""
        worker = None if self.check_of is None else self.check_of.worker
        return "" if worker is None else worker.name

    def __len__(self) -> int:
        return self.last - self.first

    def __str__(self) -> str:
        if len(self) == 1:
            return f"genome {self.first}"
        return f"genomes {self.first} to {self.last - 1}"


@dataclass(eq=False)
class Flight:
    """A piece at a seat."""

    piece: Piece
    seat: Seat
    began: float
    """Time on the monotonic clock, in seconds."""
    late_after: float
    future: Future[ShardReply]

    def is_late(self, now: float) -> bool:
        """Return True if the answer should have come."""
        return now - self.began > self.late_after


class Work:
    """A population: which genomes are to be sent, under way, or done.

    Args:
        population: Number of genomes.
    """

    def __init__(self, population: int) -> None:
        self._population = population
        self._next = 0
        self._again: deque[Piece] = deque()
        self._pieces: list[Piece] = []
        self._missing = population

    @property
    def is_done(self) -> bool:
        """True if all genomes have results."""
        return self._missing == 0

    def take(self, seat: Seat, seats: Sequence[Seat], engine: str) -> Piece | None:
        """Return what to send to a seat next; None if everything was sent."""
        while self._again:
            piece = self._again.popleft()
            if piece.result is None:
                return piece
        left = self._population - self._next
        if not left:
            return None
        size = shard_size(seat, seats, left, self._population, engine)
        piece = Piece(self._next, self._next + size)
        self._next = piece.last
        self._pieces.append(piece)
        return piece

    def again(self, piece: Piece) -> None:
        """Let a piece be sent once more, before all others, in halves.

        Where workers are lost all the time smaller pieces may still be finished; and a genome that
        ends its workers is found.
        """
        halves = [piece]
        if len(piece) > 1:
            middle = piece.first + len(piece) // 2
            halves = [
                Piece(first, last, failures=piece.failures)
                for first, last in ((piece.first, middle), (middle, piece.last))
            ]
            index = self._pieces.index(piece)
            self._pieces[index : index + 1] = halves
        self._again.extend(halves)

    def finish(self, piece: Piece, result: RolloutResult, worker: WorkerFacts) -> None:
        """Keep the first result of a piece."""
        piece.result, piece.worker = result, worker
        self._missing -= len(piece)

    def second(self, seat: Seat, now: float) -> Piece | None:
        """Return what an idle seat shall evaluate though it is under way elsewhere.

        Late pieces come first, then, if only a tenth of the population is missing, those that
        were sent last, which may not have begun.
        """
        late: list[Piece] = []
        others: list[Piece] = []
        for piece in self._under_way():
            if any(flight.seat == seat for flight in piece.flights):
                continue
            if all(flight.is_late(now) for flight in piece.flights):
                late.append(piece)
            elif len(piece.flights) == 1:
                others.append(piece)
        if late:
            return late[0]
        is_end = self._missing <= max(1, _LAST * self._population)
        return others[-1] if others and is_end else None

    def _under_way(self) -> Iterator[Piece]:
        return (piece for piece in self._pieces if piece.result is None and piece.flights)

    def whole(self) -> RolloutResult:
        """Join the results in the order of the genomes."""
        results = [piece.result for piece in self._pieces]  # which were cut in this order
        return joined([result for result in results if result is not None])
