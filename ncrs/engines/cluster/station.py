"""What a worker does: says what it is, and evaluates shards, one at a time."""

from __future__ import annotations

import os
import platform
import sys
import threading
from dataclasses import dataclass
from functools import lru_cache
from threading import Lock
from time import perf_counter, sleep
from typing import Any

import numba
import numpy as np

from ncrs.engines.base import Engine, RolloutResult, make_engine, resolve_engine
from ncrs.engines.cluster.records import Setup, Shard, ShardReply, WorkerFacts

_NAP_S = 0.05
"""Time for which a worker that declines a shard is busy, so that another takes the next one."""
_KEPT = 4
"""Number of engines that a process keeps ready."""


def own_versions() -> dict[str, str]:
    """Return the versions, here, of the packages that determine results."""
    import ncrs

    return {"ncrs": ncrs.__version__, "numba": numba.__version__, "numpy": np.__version__}


def describe_worker(setup: Setup) -> WorkerFacts:
    """Return the facts about the worker that this is called on."""
    name, threads = _name_and_threads()
    settings = setup.settings()
    return WorkerFacts(
        name=name,
        host=platform.node(),
        threads=setup.threads or threads,
        engine=resolve_engine(setup.engine, settings),
        versions=own_versions(),
    )


def evaluate_shard(shard: Shard) -> ShardReply:
    """Evaluate a shard on the worker that this is called on.

    Raises:
        EngineSettingError: If the engine or the task cannot be used here.
    """
    name, _ = _name_and_threads()
    with _making:  # of which the cache would make two
        station = _station(shard.setup, name)
    if shard.not_on == name:
        sleep(_NAP_S)
        return ShardReply(station.facts, None, 0.0)
    with station.turn:
        start = perf_counter()
        result = station.roll_out(shard)
        return ShardReply(station.facts, result, perf_counter() - start)


@dataclass(frozen=True)
class _Station:
    engine: Engine
    facts: WorkerFacts
    turn: Lock
    """Held during an evaluation, which uses all threads: the next shard waits here, unpacked."""

    def roll_out(self, shard: Shard) -> RolloutResult:
        return self.engine.roll_out(shard.genomes, shard.scenario_rows(), bodies=shard.bodies)


_making = Lock()


@lru_cache(maxsize=_KEPT)
def _station(setup: Setup, worker: str) -> _Station:
    """Make the engine of a worker; one process may hold several workers."""
    facts = describe_worker(setup)
    # Functions of a registered task need not reach further processes: Box2D runs in this one.
    workers = 1 if facts.engine == "box2d" else facts.threads
    return _Station(make_engine(facts.engine, setup.settings(), workers), facts, Lock())


def _name_and_threads() -> tuple[str, int]:
    worker = _dask_worker()
    if worker is not None:
        return str(worker.address), int(worker.state.nthreads)
    name = f"process {os.getpid()} on {platform.node()}"
    if threading.current_thread() is not threading.main_thread():
        name += f", thread {threading.get_ident()}"
    return name, 1


def _dask_worker() -> Any:
    """Return the Dask worker that runs this thread's task; None if there is none."""
    module = sys.modules.get("distributed.worker")
    if module is None:
        return None
    try:
        return module.get_worker()
    except ValueError:
        return None
