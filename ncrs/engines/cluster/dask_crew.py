"""Workers of a Dask cluster, each of which is given its own shards."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Coroutine, Sequence
from concurrent.futures import Future
from time import monotonic, sleep
from typing import Any

import dask
from distributed import Client
from distributed.client import FutureCancelledError
from distributed.comm import CommClosedError
from distributed.scheduler import KilledWorker

from ncrs.engines.base import EngineError, EngineSettingError
from ncrs.engines.cluster.crew import Admission, Crew, Seat, WorkerLost
from ncrs.engines.cluster.records import Setup, WorkerFacts
from ncrs.engines.cluster.station import describe_worker
from ncrs_envs.notices import notice

_LARGE = "distributed.admin.large-graph-warning-threshold"
_LOOK_S = 0.25
"""Time between two looks at who is there."""
_SCHEDULER_S = 60.0
"""Time after which a scheduler that does not answer counts as lost."""
_FIRST_WORKER_S = 120.0
_FIRST_WORDS_S = 30.0
"""Time that workers have to say what they are before a run starts without them."""


class _Member:
    """A worker that the scheduler knows."""

    def __init__(self, answer: Future[WorkerFacts]) -> None:
        self.answer = answer
        """What it will say of itself."""
        self.facts: WorkerFacts | None = None
        """The same, once it has been admitted."""
        self.is_judged = False


class DaskCrew(Crew):
    """The workers of a Dask cluster, as they come and go.

    Args:
        client: Client of the cluster; ``close`` closes it.
        setup: What workers shall evaluate.
        admission: Judge of workers.
        least: Number of workers to wait for at the start.

    Raises:
        EngineSettingError: A worker that is there from the start must not take part, or none came.
        EngineError: The scheduler was lost.
    """

    def __init__(self, client: Client, setup: Setup, admission: Admission, least: int = 1) -> None:
        self._client, self._setup, self._admission = client, setup, admission
        self._address = str(client.scheduler.address)
        self._loop: asyncio.AbstractEventLoop = client.loop.asyncio_loop
        self._present: frozenset[str] = frozenset()
        """Addresses of the workers that the scheduler knows."""
        self._members: dict[str, _Member] = {}
        self._is_silent = False
        """True once the scheduler did not answer."""
        self._watching = self._call(self._watch())
        try:
            self._wait_for(least)
        except BaseException:
            self.close()
            raise

    def _wait_for(self, least: int) -> None:
        """Wait until enough workers are there, and all have said what they are."""
        began = monotonic()
        while True:
            objections = self._judge()
            if objections:
                raise EngineSettingError(objections[0])
            waited = monotonic() - began
            all_known = all(member.facts for member in self._members.values())
            enough = len(self._admitted()) >= least
            if enough and (all_known or waited > _FIRST_WORDS_S):
                break
            if waited > _FIRST_WORKER_S:
                raise EngineSettingError(
                    f"{len(self._admitted())} workers of the Dask scheduler {self._address} "
                    f"answered within {_FIRST_WORKER_S:.0f} s, {least} are needed; start them "
                    f"with: dask worker {self._address}"
                )
            sleep(_LOOK_S / 5)
        facts = self._admitted()
        notice(
            f"workers: {len(facts)}; computers: {len({each.host for each in facts})}; threads: "
            f"{sum(each.threads for each in facts)}; engine: {self._admission.engine}"
        )

    def _admitted(self) -> list[WorkerFacts]:
        return [member.facts for member in self._members.values() if member.facts is not None]

    def seats(self) -> Sequence[Seat]:
        """List the workers that take part.

        Raises:
            EngineError: The scheduler was lost.
        """
        before = len(self._admitted())
        for objection in self._judge():  # it came late: the others go on
            notice(f"{objection} It gets nothing to do.")
        facts = self._admitted()
        if len(facts) > before:
            notice(f"a worker joined: {facts[-1]}; workers: {len(facts)}")
        return [Seat(each.name, each.threads) for each in facts]

    def _judge(self) -> list[str]:
        """Take up and drop workers; return the objections to new ones."""
        if self._is_lost:
            raise EngineError(
                f"The Dask scheduler {self._address} does not answer any more; start it again, "
                "with its workers, then resume the run."
            )
        present = self._present
        for address in [each for each in self._members if each not in present]:
            member = self._members.pop(address)
            member.answer.cancel()
            if member.facts is not None:
                notice(f"the worker {member.facts} left; workers: {len(self._admitted())}")
        objections = []
        for address in sorted(present):
            if address not in self._members:
                answer = self.submit(Seat(address, 1), describe_worker, self._setup)
                self._members[address] = _Member(answer)
            member = self._members[address]
            if member.answer.done() and not member.is_judged:
                member.is_judged = True
                objection = self._objection(address, member)
                if objection is not None:
                    objections.append(objection)
        return objections

    def _objection(self, address: str, member: _Member) -> str | None:
        error = member.answer.exception()
        if isinstance(error, WorkerLost):
            return None  # it will be gone
        if error is not None:
            return f"The worker {address} cannot take part: {error}."
        facts = member.answer.result()
        objection = self._admission.objection(facts)
        if objection is None:
            member.facts = facts
        return objection

    def submit(self, seat: Seat, function: Callable[[Any], Any], argument: Any) -> Future[Any]:
        """Apply a function on one worker."""
        return self._call(self._run(seat.name, function, argument))

    def _call(self, work: Coroutine[Any, Any, Any]) -> Future[Any]:
        return asyncio.run_coroutine_threadsafe(work, self._loop)

    async def _run(self, address: str, function: Callable[[Any], Any], argument: Any) -> Any:
        with dask.config.set({_LARGE: "1 TB"}):  # a shard is as large as it has to be
            work = self._client.submit(
                function, argument, workers=[address], allow_other_workers=False, pure=False
            )
        answer = asyncio.ensure_future(work.result())
        # Whoever waits within Dask must end by itself: if it were cancelled, errors would be left.
        answer.add_done_callback(lambda done: done.cancelled() or done.exception())
        try:
            return await asyncio.shield(answer)
        except (KilledWorker, FutureCancelledError, CommClosedError) as error:
            raise WorkerLost(f"{address} was lost ({error}).") from error
        finally:
            work.release()

    async def _watch(self) -> None:
        """Keep the addresses of the workers up to date, until the scheduler is lost."""
        while True:
            try:
                present = await asyncio.wait_for(self._client.scheduler.ncores(), _SCHEDULER_S)
            except (OSError, asyncio.TimeoutError):
                self._is_silent = True
                return
            self._present = frozenset(present)
            await asyncio.sleep(_LOOK_S)

    @property
    def _is_lost(self) -> bool:
        return self._is_silent or self._client.status != "running"

    def close(self) -> None:
        """Leave the cluster; its workers stay."""
        self._watching.cancel()
        log = logging.getLogger("distributed.client")
        was_disabled = log.disabled
        log.disabled = was_disabled or self._is_lost  # the user has been told, in one sentence
        try:
            self._client.close()
        finally:
            log.disabled = was_disabled
