"""The evaluation of populations by a crew: sending, taking over, gathering by index.

The results are those of the shards in the order of the genomes, whoever computed them. Workers may
come and go, stop or be slow: a shard whose worker is gone is sent again; one that is late, or among
the last tenth, is sent to an idle worker too, and the first answer counts.
"""

from __future__ import annotations

import queue
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, CancelledError
from dataclasses import dataclass
from statistics import median
from time import monotonic

from ncrs.engines.base import (
    EngineError,
    EngineSettingError,
    EvaluationInterrupted,
    RolloutResult,
    StopCheck,
)
from ncrs.engines.cluster.audit import Audit
from ncrs.engines.cluster.crew import Admission, Crew, Seat, WorkerLost
from ncrs.engines.cluster.records import Shard, ShardReply
from ncrs.engines.cluster.station import evaluate_shard
from ncrs.engines.cluster.work import Flight, Piece, Work

_POLL_S = 0.05
_DEPTH = 2
"""Shards at a worker: one that it evaluates, and the next."""
_LATE = 4.0
"""A shard is late after this many times the usual time for its genomes."""
_LEAST_LATE_S = 1.0
_FIRST_LATE_S = 120.0
"""The same while nothing is known of the usual time: workers may have to compile first."""
_REMEMBERED = 100
_MAX_LOSSES = 10
"""Number of workers that a shard may lose."""
_MAX_REFUSALS = 5
"""Number of workers that may decline a check."""
_WITHOUT_WORKERS_S = 300.0
"""Time for which a population waits for a worker."""

MakeShard = Callable[[int, int, str], Shard]
"""Function of first genome, end, and name of the worker that must decline, that makes a shard."""


@dataclass
class Tally:
    """Counts since the engine was made."""

    lost: int = 0
    """Shards that were sent again because their worker was lost."""
    duplicated: int = 0
    """Shards that were sent to a second worker because they were late or the last."""
    busy_s: float = 0.0
    """Time that the workers spent on the last population, added up over their threads."""


class Dispatcher:
    """Evaluates populations on a crew.

    Args:
        crew: The workers.
        admission: Judge of anonymous workers, which are known when they have answered.
        audit: Choice and comparison of what is evaluated twice.
    """

    def __init__(self, crew: Crew, admission: Admission, audit: Audit) -> None:
        self._crew, self._admission, self._audit = crew, admission, audit
        self._seats: Sequence[Seat] = ()
        self._flights: dict[Seat, list[Flight]] = {}
        """Shards under way, those of earlier populations that workers still hold among them."""
        self._landed: queue.SimpleQueue[Flight] = queue.SimpleQueue()
        self._pace: deque[float] = deque(maxlen=_REMEMBERED)
        """Seconds of one thread per genome, from sending to the answer, of the last shards."""
        self._checks: deque[Piece] = deque()
        """Pieces to evaluate on a second worker."""
        self.tally = Tally()

    def evaluate(
        self, population: int, make_shard: MakeShard, should_stop: StopCheck
    ) -> RolloutResult:
        """Evaluate genomes 0 to ``population`` - 1.

        Raises:
            EvaluationInterrupted: ``should_stop`` returned True.
            EngineError: The cluster was lost, or a shard failed, or lost too many workers.
            EngineSettingError: A worker cannot take part.
        """
        work = Work(population)
        self._audit.begin(population)
        self._checks.clear()
        self.tally.busy_s = 0.0
        seen = monotonic()
        try:
            while not work.is_done or self._is_checking():
                if should_stop():
                    raise EvaluationInterrupted
                self._seats = self._crew.seats()
                if self._seats:
                    seen = monotonic()
                elif monotonic() - seen > _WITHOUT_WORKERS_S:
                    raise EngineError(
                        f"No worker was there for {_WITHOUT_WORKERS_S:.0f} s; start some, then "
                        "resume the run."
                    )
                self._drop_lost(work)
                for seat in self._seats:
                    self._fill(seat, work, make_shard)
                self._gather(work)
        except BaseException:
            self._forget()
            raise
        return work.whole()

    def _fill(self, seat: Seat, work: Work, make_shard: MakeShard) -> None:
        """Send to a seat what it can take, unless it is late with something."""
        now = monotonic()
        held = self._flights.setdefault(seat, [])
        while len(held) < _DEPTH and not _is_stuck(held, now):
            piece = work.take(seat, self._seats, self._admission.engine)
            if piece is None and not held:
                piece = self._check_for(seat)
                if piece is None:
                    piece = work.second(seat, now)
                    self.tally.duplicated += piece is not None
            if piece is None:
                return
            self._send(piece, seat, make_shard)

    def _send(self, piece: Piece, seat: Seat, make_shard: MakeShard) -> None:
        shard = make_shard(piece.first, piece.last, piece.not_on)
        late_after = _FIRST_LATE_S
        if self._pace:
            usual = median(self._pace) * len(piece) / seat.threads
            late_after = max(_LEAST_LATE_S, _LATE * usual)
        began = monotonic()
        flight = Flight(
            piece, seat, began, late_after, self._crew.submit(seat, evaluate_shard, shard)
        )
        self._flights[seat].append(flight)
        piece.flights.append(flight)
        flight.future.add_done_callback(lambda _: self._landed.put(flight))

    def _check_for(self, seat: Seat) -> Piece | None:
        """Return a check that a worker may do, since another evaluated those genomes."""
        for check in self._checks:
            if check.not_on != seat.name:
                self._checks.remove(check)
                return check
        return None

    def _is_checking(self) -> bool:
        """Return True if a check is under way, or could be, on workers that answer in time."""
        now = monotonic()
        held = {seat: self._flights.get(seat, []) for seat in self._seats}
        working = [seat for seat in self._seats if not _is_stuck(held[seat], now)]
        if any(flight.piece.check_of for seat in working for flight in held[seat]):
            return True
        enough = not self._crew.is_anonymous or len(working) > 1
        return enough and any(
            check.not_on != seat.name for check in self._checks for seat in working
        )

    def _gather(self, work: Work) -> None:
        """Wait for an answer, though not for long, and take all that are there."""
        try:
            self._land(self._landed.get(timeout=_POLL_S), work)
            while True:
                self._land(self._landed.get_nowait(), work)
        except queue.Empty:
            return

    def _land(self, flight: Flight, work: Work) -> None:
        piece, held = flight.piece, self._flights.get(flight.seat, [])
        if flight not in held:
            return  # it was given up
        held.remove(flight)
        piece.flights.remove(flight)
        if piece.result is not None:
            return  # another worker was faster
        try:
            reply = flight.future.result()
        except (WorkerLost, BrokenExecutor, CancelledError) as error:
            self._lose(piece, work, str(error))
        except EngineSettingError:
            raise
        except Exception as error:  # whatever the worker's engine raised
            raise EngineError(f"{error} while evaluating {piece} on {flight.seat.name}.") from error
        else:
            self._accept(flight, reply, work)

    def _accept(self, flight: Flight, reply: ShardReply, work: Work) -> None:
        piece = flight.piece
        objection = self._admission.objection(reply.worker) if self._crew.is_anonymous else None
        if objection is not None:
            raise EngineSettingError(objection)
        if reply.result is None:
            piece.failures += 1
            if piece.failures < _MAX_REFUSALS:
                self._checks.append(piece)
        elif piece.check_of is not None:
            self._audit.compare(piece, reply.result, reply.worker)
        else:
            threads = reply.worker.threads
            self._pace.append((monotonic() - flight.began) * threads / len(piece))
            self.tally.busy_s += reply.seconds * threads
            work.finish(piece, reply.result, reply.worker)
            self._checks.extend(self._audit.checks(piece))

    def _drop_lost(self, work: Work) -> None:
        """Give up what was at workers that have left."""
        for seat in self._flights.keys() - set(self._seats):
            for flight in self._flights.pop(seat):
                flight.future.cancel()
                flight.piece.flights.remove(flight)
                if flight.piece.result is None:
                    self._lose(flight.piece, work, f"{seat.name} left.")

    def _lose(self, piece: Piece, work: Work, how: str) -> None:
        """Have a piece evaluated by another worker, unless one is at it already."""
        if piece.check_of is not None:
            self._checks.append(piece)
        elif not piece.flights:
            self.tally.lost += 1
            piece.failures += 1
            if piece.failures > _MAX_LOSSES:
                raise EngineError(
                    f"{piece.failures} workers were lost while evaluating {piece}; the last: {how}"
                )
            work.again(piece)

    def _forget(self) -> None:
        """Give up all that is under way."""
        for flights in self._flights.values():
            for flight in flights:
                flight.future.cancel()
        self._flights.clear()


def _is_stuck(held: Sequence[Flight], now: float) -> bool:
    return any(flight.is_late(now) for flight in held)
