"""Seconds of one whole generation, and memory, of every optimizer.

    python -m benchmarks.generation [--json] [--optimizers NAME ...]

Each optimizer trains in a process of its own, in the real training loop: on the batched engine,
with 12 episodes of 100 steps, and with its own default settings (population 112 for CMA-ES, 128 for
CMA-ME). Only the simulated genomes are replaced by ones that grow nearly full bodies, as those of a
run under way do. ``--json`` prints ``{optimizer: {"ask_s", "rollout_s", "tell_s", "log_s",
"checkpoint_s", "total_s", "peak_memory_gb"}}``.

- ``ask_s`` and ``tell_s`` are means: CMA-ES renews its factor of the covariance every few
  generations only, and each emitter of CMA-ME every few of its own turns, so its run is longer.
  ``tell_s`` includes the median time of adding to the archive. The others are medians.
- ``checkpoint_s`` is the maximum time for which one checkpoint held the loop up. Here there is one
  every 5 s (by default every 30 s), and the archive is nearly empty. ``total_s`` is the sum of the
  five: a generation with a checkpoint, without drawing scenarios and statistics (milliseconds).
- ``peak_memory_gb`` is that of the whole process, about 0.6 GB of it Python, torch and numba.
- ``cma_es_pycma`` is the same optimizer with pycma's own linear algebra, for the ratio.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from numpy.typing import NDArray
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from benchmarks.workload import nearly_full_genomes
from ncrs.engines.base import Engine, Evaluation, make_engine
from ncrs.evolution.optimizers import OPTIMIZERS, CMAESSettings
from ncrs.evolution.optimizers.settings import EmitterSettings
from ncrs.runs.engine_settings import EngineSettings
from ncrs.runs.settings import TrainConfig
from ncrs.training import trainer as training

TASK = "light_chase"
GENERATIONS = 24
"""Number of generations: three of CMA-ES's intervals between two factorisations."""
TURNS = 8
"""Number of turns of every emitter: one of those intervals."""
CHECKPOINT_SECONDS = 5.0
MAX_TOTAL_S = 1.5
PLAIN = "cma_es_pycma"
_MAX_GENOMES = 256
# Phases of the training loop, and the column that each is part of.
_PHASES: Mapping[str, str] = {
    "ask": "ask_s",
    "evaluate": "rollout_s",
    "archive": "tell_s",
    "tell": "tell_s",
    "log": "log_s",
    "checkpoint": "checkpoint_s",
}


def _mean(values: list[float]) -> float:
    return float(np.mean(values))


def _median(values: list[float]) -> float:
    return float(np.median(values))


_STATISTICS: Mapping[str, Callable[[list[float]], float]] = {
    "ask": _mean,
    "tell": _mean,
    "checkpoint": max,
}
COLUMNS = ("ask_s", "rollout_s", "tell_s", "log_s", "checkpoint_s", "total_s", "peak_memory_gb")


class FullBodies:
    """An engine that simulates given genomes in place of those that it receives."""

    def __init__(self, engine: Engine, genomes: NDArray[np.float32]) -> None:
        self._engine = engine
        self._genomes = genomes

    def evaluate(self, genomes: Any, *arguments: Any) -> Evaluation:
        """Evaluate as many of the given genomes as were received."""
        return self._engine.evaluate(self._genomes[: len(genomes)], *arguments)

    def metrics(self) -> dict[str, float]:
        """Return the engine's own curves."""
        return self._engine.metrics()

    def __enter__(self) -> FullBodies:
        self._engine.__enter__()
        return self

    def __exit__(self, *exception: Any) -> None:
        self._engine.__exit__(*exception)


def _config(optimizer: str, generations: int) -> TrainConfig:
    if optimizer == PLAIN:
        settings = CMAESSettings(linear_algebra="pycma")
    else:
        settings = OPTIMIZERS[optimizer].settings()
    return TrainConfig(
        optimizer=settings,
        engine=EngineSettings(name="batched"),
        episodes=12,
        symmetric=False,
        mirroring="none",
        generations=generations + 2,
        champion_every=generations + 2,
        champion_episodes=1,
        checkpoint_seconds=CHECKPOINT_SECONDS,
    )


def measure(optimizer: str, genomes: NDArray[np.float32], generations: int) -> dict[str, float]:
    """Train in this process, and read the time of each phase from the run's curves."""
    config = _config(optimizer, generations)
    if isinstance(config.optimizer, EmitterSettings):
        generations = max(generations, TURNS * config.optimizer.emitters)
    with tempfile.TemporaryDirectory() as folder:
        with mock.patch.object(
            training,
            "make_engine",
            lambda *arguments: FullBodies(make_engine(*arguments), genomes),
        ):
            training.train(_config(optimizer, generations), folder)
        events = EventAccumulator(folder, size_guidance={"scalars": 0})
        events.Reload()
        result = dict.fromkeys(COLUMNS, 0.0)
        for phase, column in _PHASES.items():
            values = _curve(events, f"time/{phase}_s", generations)
            result[column] += _STATISTICS.get(phase, _median)(values)
    result["total_s"] = sum(result.values())
    unit = 2**30 if sys.platform == "darwin" else 2**20
    result["peak_memory_gb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
    return result


def _curve(events: EventAccumulator, tag: str, generations: int) -> list[float]:
    """Read a curve without the first generation, which compiles, and the last, which ends all."""
    too_short = f"{tag} has no values: the run was too short, use more --generations."
    if tag not in events.Tags()["scalars"]:
        raise RuntimeError(too_short)
    values = [e.value for e in events.Scalars(tag) if 1 <= e.step <= generations]
    if not values:
        raise RuntimeError(too_short)
    return values


def _in_own_process(optimizer: str, genomes: Path, generations: int) -> dict[str, float]:
    command = [sys.executable, "-m", "benchmarks.generation", "--own-process", optimizer]
    command += ["--genomes", str(genomes), "--generations", str(generations)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{optimizer} failed:\n{done.stderr}")
    result: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return result


def main(arguments: list[str] | None = None) -> int:
    """Measure; returns 1 if a generation of CMA-ES takes longer than the bar."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    names = [*OPTIMIZERS, PLAIN]
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--optimizers", nargs="+", default=list(OPTIMIZERS), choices=names)
    parser.add_argument("--generations", type=int, default=GENERATIONS)
    parser.add_argument("--own-process", metavar="OPTIMIZER", help=argparse.SUPPRESS)
    parser.add_argument("--genomes", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.own_process:
        genomes = np.load(options.genomes)
        print(json.dumps(measure(options.own_process, genomes, options.generations)))
        return 0
    results = {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "genomes.npy"
        np.save(path, nearly_full_genomes(TASK, _MAX_GENOMES))
        if not options.json:
            print(f"{'':<14}" + "".join(f"{column:>15}" for column in COLUMNS))
        for name in options.optimizers:
            results[name] = row = _in_own_process(name, path, options.generations)
            if not options.json:
                print(f"{name:<14}" + "".join(f"{row[c]:>15.3f}" for c in COLUMNS), flush=True)
    if options.json:
        print(json.dumps(results, indent=2))
    return int(any(results[n]["total_s"] > MAX_TOTAL_S for n in results if n == "cma_es"))


if __name__ == "__main__":
    sys.exit(main())
