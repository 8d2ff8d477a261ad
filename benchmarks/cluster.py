"""What a cluster costs: ``python -m benchmarks.cluster [--json]``.

Times whole evaluations of LightChase with nearly full bodies, 12 episodes of 100 steps, on the
threads of this computer (``batched``) and on as many Dask workers of one thread each (``dask``, on
this computer too), for each population. The efficiency is the ratio of the two times; both are
measured in turn, so that a noisy computer treats them alike, and are medians.

From the same runs come the parts of a model, in seconds of processor time, which other programs
change little: what a thread takes for a genome, and what the sender (with the scheduler, which is
in its process) takes for a shard with its answer, and for a genome in it. Only ``message`` is time
on the clock. The model's efficiency at W workers of T threads is ::

    ideal / (max(ideal + wait, sending) + wait)

with ``ideal`` the time of P genomes on all threads, ``sending`` the sender's time for all shards,
and ``wait`` the time of a message, which is spent at the start and the end. What it leaves out:
networks slower than this computer's own, and workers that wait for each other.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from benchmarks.workload import EPISODES, nearly_full_genomes
from ncrs.engines.base import Engine, make_engine
from ncrs.engines.cluster.crew import Seat
from ncrs.engines.cluster.cutting import shard_size
from ncrs.engines.cluster.dask import DaskEngine
from ncrs.engines.cluster.records import Shard, ShardReply, travelling_rows
from ncrs.engines.cluster.sharded import ShardedEngine
from ncrs.engines.cluster.station import evaluate_shard
from ncrs_envs.cores import available_cores
from ncrs_envs.scenario import sample_scenarios
from ncrs_envs.tasks import TaskSettings

TASK = "light_chase"
POPULATIONS = (112, 1024, 8192)
PREDICTED_POPULATIONS = (112, 1024, 8192, 100_000)
PREDICTED_WORKERS = ((8, 1), (64, 1), (512, 1), (8, 64))
"""Numbers of workers, and threads of each."""
_DISTINCT = 512
"""Number of different genomes; larger populations repeat them."""
_PROBES, _PROBE_SIZE = 100, 33
"""Number of shards to send without work, and genomes in the larger ones."""


@dataclass(frozen=True)
class Costs:
    """Parts of the model, in seconds."""

    genome: float
    """Processor time of a thread for a genome."""
    shard: float
    """Processor time of the sender for a shard, whatever is in it."""
    transfer: float
    """Processor time of the sender for each genome in it."""
    message: float
    """Shortest time from sending a shard to its answer, without the work."""


def shards(population: int, workers: int, threads: int) -> int:
    """Count the shards into which a population is cut."""
    seats = [Seat(str(index), threads) for index in range(workers)]
    left, count = population, 0
    while left:
        left -= shard_size(seats[0], seats, left, population, "batched")
        count += 1
    return count


def efficiency(costs: Costs, population: int, workers: int, threads: int) -> float:
    """Predict the part of all threads' time that is spent on evaluating."""
    ideal = population * costs.genome / (workers * threads)
    sending = shards(population, workers, threads) * costs.shard + population * costs.transfer
    return ideal / (max(ideal + costs.message, sending) + costs.message)


def _seconds(engine: Engine, genomes: Any, scenarios: Any) -> float:
    start = time.perf_counter()
    engine.evaluate(genomes, scenarios)
    return time.perf_counter() - start


def measure(populations: Sequence[int], workers: int, repeats: int) -> dict[str, Any]:
    """Measure both engines by population, and the parts of the model."""
    task = TaskSettings(TASK)
    scenarios = sample_scenarios(TASK, 1, EPISODES)
    distinct = nearly_full_genomes(TASK, min(_DISTINCT, max(populations)))
    rows = []
    with (
        make_engine("batched", task, workers) as threads,
        DaskEngine(task, workers) as cluster,
    ):
        for engine in (threads, cluster):  # compiles, connects
            engine.evaluate(distinct[: 2 * workers], scenarios)
        for population in populations:
            genomes = np.resize(distinct, (population, distinct.shape[1]))
            times = [
                (_seconds(threads, genomes, scenarios), _seconds(cluster, genomes, scenarios))
                for _ in range(repeats)
            ]
            batched_s, dask_s = (float(np.median(column)) for column in zip(*times, strict=True))
            rows.append(
                {
                    "population": population,
                    "batched_s": batched_s,
                    "dask_s": dask_s,
                    "efficiency": batched_s / dask_s,
                    "shards": shards(population, workers, 1),
                }
            )
        start = time.process_time()
        threads.evaluate(distinct, scenarios)
        genome_s = (time.process_time() - start) / len(distinct)
        costs = Costs(genome_s, *_message_costs(cluster))
    return {"workers": workers, "rows": rows, "costs": asdict(costs)}


def _message_costs(engine: ShardedEngine) -> tuple[float, float, float]:
    """Measure what shards cost without their work: genomes of zeros grow bodies of no use."""
    scenarios = travelling_rows([sample_scenarios(TASK, 1, 1)])
    seats = engine.crew.seats()

    def send(index: int, size: int) -> Future[ShardReply]:
        genomes = np.zeros((size, engine.layout.num_parameters), dtype=np.float32)
        shard = Shard(genomes, scenarios, engine.setup)
        return engine.crew.submit(seats[index % len(seats)], evaluate_shard, shard)

    def seconds_per_shard(size: int) -> float:
        start = time.process_time()
        for future in [send(index, size) for index in range(_PROBES)]:
            future.result()
        return (time.process_time() - start) / _PROBES

    def message() -> float:
        start = time.perf_counter()
        send(0, 1).result()
        return time.perf_counter() - start

    one, many = (min(seconds_per_shard(size) for _ in range(3)) for size in (1, _PROBE_SIZE))
    transfer = max(0.0, many - one) / (_PROBE_SIZE - 1)
    return one, transfer, min(message() for _ in range(_PROBES))


def report(result: dict[str, Any]) -> list[str]:
    """Format the measurements and the predictions as lines of text."""
    workers, costs = result["workers"], Costs(**result["costs"])
    lines = [
        f"{TASK}, nearly full bodies, {EPISODES} episodes; {workers} threads against {workers} "
        "workers of one thread\n",
        f"{'population':>10} {'batched_s':>10} {'dask_s':>10} {'shards':>7} {'efficiency':>11} "
        f"{'predicted':>10}",
    ]
    for row in result["rows"]:
        predicted = efficiency(costs, row["population"], workers, 1)
        lines.append(
            f"{row['population']:>10,} {row['batched_s']:>10.3f} {row['dask_s']:>10.3f} "
            f"{row['shards']:>7} {row['efficiency']:>11.0%} {predicted:>10.0%}"
        )
    lines.append("\nmilliseconds")
    lines += [f"  {name:<9} {1000 * value:>8.3f}" for name, value in result["costs"].items()]
    heads = [f"{count} x {threads}" for count, threads in PREDICTED_WORKERS]
    lines.append("\npredicted efficiency (workers x threads of each)\n")
    lines.append(f"{'population':>10}" + "".join(f"{head:>10}" for head in heads))
    for population in PREDICTED_POPULATIONS:
        values = (efficiency(costs, population, *shape) for shape in PREDICTED_WORKERS)
        lines.append(f"{population:>10,}" + "".join(f"{value:>10.0%}" for value in values))
    return lines


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--populations", type=int, nargs="+", default=POPULATIONS)
    parser.add_argument("--workers", type=int, default=available_cores())
    parser.add_argument("--repeats", type=int, default=5, help="default: %(default)s")
    options = parser.parse_args(arguments)
    result = measure(options.populations, options.workers, options.repeats)
    print(json.dumps(result) if options.json else "\n".join(report(result)))


if __name__ == "__main__":
    main()
