"""The engine that hands shards of a population to a crew."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from ncrs.engines.arguments import GivenBodies, ScenarioRows
from ncrs.engines.base import (
    AUDIT_SHARE,
    AUTO_ENGINE,
    CLUSTER_ENGINES,
    REFUSE,
    Engine,
    EngineSettingError,
    RolloutResult,
    StopCheck,
    resolve_engine,
)
from ncrs.engines.cluster.audit import Audit
from ncrs.engines.cluster.crew import Admission, Crew
from ncrs.engines.cluster.dispatch import Dispatcher
from ncrs.engines.cluster.records import Shard, make_setup, travelling_rows
from ncrs_envs.notices import notice
from ncrs_envs.tasks import TaskSettings

WORTH_IT_S = 1.0
"""Work per population, in seconds of all threads, below which a cluster hardly pays."""
_WARM = 3
"""Number of populations after which workers have compiled and connected."""


@dataclass(frozen=True)
class WorkerOptions:
    """How workers evaluate; explained with ``ncrs.runs.settings.EngineSettings``.

    Raises:
        EngineSettingError: If a value is out of range.
    """

    threads: int | None = None
    on_workers: str = AUTO_ENGINE
    audit: float = AUDIT_SHARE
    other_versions: str = REFUSE

    def __post_init__(self) -> None:
        if self.threads is not None and self.threads < 1:
            raise EngineSettingError(f"engine.threads must be positive, got {self.threads!r}.")
        if self.on_workers in CLUSTER_ENGINES:
            raise EngineSettingError(
                f"engine.on_workers must be an engine that computes, got {self.on_workers!r}."
            )


class ShardedEngine(Engine):
    """Engine whose results come from the workers of a crew; see ``Engine``.

    Args:
        settings: Task and its settings.
        workers: Number of workers to start, where this engine starts them.
        options: How the workers evaluate.

    Raises:
        EngineSettingError: An option is out of range, or a registered task cannot be sent.
    """

    def __init__(self, settings: TaskSettings, workers: int | None, options: WorkerOptions) -> None:
        super().__init__(settings, workers)
        expected = resolve_engine(options.on_workers, settings)
        self.setup = make_setup(settings, options.on_workers, options.threads)
        self.admission = Admission(options.other_versions, expected)
        self._audit = Audit(options.audit)
        self._crew: Crew | None = None
        self._dispatcher: Dispatcher | None = None
        self._populations = self._largest = 0
        self._overhead_s = 0.0

    @abstractmethod
    def _make_crew(self) -> Crew:
        """Start or join the workers."""

    @property
    def crew(self) -> Crew:
        """The workers, started or joined when they are first needed."""
        if self._crew is None:
            self._crew = self._make_crew()
            self._dispatcher = Dispatcher(self._crew, self.admission, self._audit)
        return self._crew

    def _rollout(
        self,
        genomes: NDArray[np.float32],
        rows: ScenarioRows,
        should_stop: StopCheck,
        bodies: GivenBodies,
    ) -> RolloutResult:
        travelling = travelling_rows(rows)

        def make_shard(first: int, last: int, not_on: str) -> Shard:
            own = travelling if len(travelling) == 1 else travelling[first:last]
            given = None if bodies is None else bodies[first:last]
            return Shard(genomes[first:last], own, self.setup, not_on, given)

        crew = self.crew
        assert self._dispatcher is not None
        start = perf_counter()
        result = self._dispatcher.evaluate(len(genomes), make_shard, should_stop)
        self._note_overhead(crew, len(genomes), perf_counter() - start)
        return result

    def _note_overhead(self, crew: Crew, population: int, seconds: float) -> None:
        """Keep the time that was not spent on evaluating; say once if it is most of a short one."""
        assert self._dispatcher is not None
        threads = sum(seat.threads for seat in crew.seats())
        busy = self._dispatcher.tally.busy_s
        self._overhead_s = seconds - busy / max(1, threads)
        self._largest = max(self._largest, population)
        if population < self._largest:
            return  # such as candidates for champion
        self._populations += 1
        if self._populations == _WARM and busy < WORTH_IT_S:
            notice(overhead_line(busy, seconds, threads))

    def metrics(self) -> dict[str, float]:
        """Return the values of the curves of the cluster."""
        if self._crew is None or self._dispatcher is None:
            return {}
        tally = self._dispatcher.tally
        return {
            "workers/count": float(len(self._crew.seats())),
            "workers/overhead_s": self._overhead_s,
            "workers/lost": float(tally.lost),
            "workers/duplicated": float(tally.duplicated),
            "workers/checked": float(self._audit.checked),
            "workers/differences": float(self._audit.differences),
        }

    def close(self) -> None:
        """Release the workers; a further evaluation starts or joins them again."""
        crew, self._crew, self._dispatcher = self._crew, None, None
        if crew is not None:
            crew.close()


def overhead_line(busy_s: float, seconds: float, threads: int) -> str:
    """Say what a cluster costs where a population is little work.

    Args:
        busy_s: Time that workers evaluated, added up over their threads.
        seconds: Time that the population took.
        threads: Number of threads of all workers.
    """
    overhead = max(0.0, seconds - busy_s / max(1, threads))
    return (
        f"a generation is {busy_s:.2g} s of work for one thread; of its {seconds:.2g} s on "
        f"{threads} threads, {overhead:.2g} s went into sending and waiting: below about "
        f"{WORTH_IT_S:.0f} s of work a cluster hardly pays; try engine=batched on one computer"
    )
