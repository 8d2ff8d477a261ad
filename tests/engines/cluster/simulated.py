"""A crew whose workers, and whose clock, a test moves: everything happens in this thread."""

from collections.abc import Callable
from concurrent.futures import Future

import numpy as np

from ncrs.engines.base import RolloutResult
from ncrs.engines.cluster.crew import Crew, Seat, WorkerLost
from ncrs.engines.cluster.records import Setup, Shard, ShardReply, WorkerFacts
from ncrs.engines.cluster.station import own_versions

SETUP = Setup(("light_chase", 5, "exponential", None), None, "batched", None)
TICK_S = 0.1


def expected(population):
    """The results of genomes 0, 1, ..., each of which is its own fitness."""
    values = np.arange(population, dtype=np.float64)[:, None]
    flags = (values % 2).astype(bool)
    bodies = np.arange(population, dtype=np.int8)[:, None, None]
    shares = np.asarray(values, dtype=np.float64)
    return RolloutResult(
        bodies, values, flags, flags, values[..., None], flags[:, 0], recovered=shares
    )


def make_shard(first, last, not_on):
    return Shard(np.arange(first, last, dtype=np.float32)[:, None], (), SETUP, not_on)


class Worker:
    """A worker that evaluates one shard per tick, in the order of their arrival."""

    def __init__(self, name, threads=1, ticks=1, error=0.0):
        self.facts = WorkerFacts(name, f"host of {name}", threads, "batched", own_versions())
        self.ticks, self.error = ticks, error
        self.is_stopped = False
        self.jobs: list[tuple[Future, Shard]] = []
        self.done: list[tuple[int, int]] = []
        self._rest = ticks

    def work(self):
        if self.is_stopped or not self.jobs:
            return
        self._rest -= 1
        if self._rest > 0:
            return
        self._rest = self.ticks
        future, shard = self.jobs.pop(0)
        if future.cancelled():
            return
        values = shard.genomes[:, 0].astype(np.int64)
        self.done.append((int(values[0]), int(values[-1]) + 1))
        result = None
        if shard.not_on != self.facts.name:
            whole = expected(int(values[-1]) + 1)
            result = RolloutResult(**{k: v[values].copy() for k, v in vars(whole).items()})
            result.episode_fitness[:] += self.error
        future.set_result(ShardReply(self.facts, result, 0.01 * len(values)))

    def die(self):
        for future, _ in self.jobs:
            if not future.cancelled():
                future.set_exception(WorkerLost(f"{self.facts.name} was killed."))


class SimulatedCrew(Crew):
    """Workers that a script changes before every tick.

    Args:
        workers: The workers that are there from the start.
        script: Function of the crew and the number of the tick.
    """

    def __init__(self, *workers, script: Callable = lambda crew, tick: None, anonymous=False):
        self.workers = list(workers)
        self.is_anonymous = anonymous
        self.now, self._tick, self._script = 0.0, 0, script

    def monotonic(self):
        return self.now

    def seats(self):
        self._script(self, self._tick)
        self._tick += 1
        self.now += TICK_S
        for worker in self.workers:
            worker.work()
        return [Seat(worker.facts.name, worker.facts.threads) for worker in self.workers]

    def submit(self, seat, function, argument):
        future = Future()
        next(w for w in self.workers if w.facts.name == seat.name).jobs.append((future, argument))
        return future

    def remove(self, worker):
        self.workers.remove(worker)
        worker.die()

    def close(self):
        pass
