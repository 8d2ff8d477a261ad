"""The engine ``cuda`` on this machine's GPU: ``python -m benchmarks.gpu [--json] [--quick]``.

In under four minutes, compilation included:

- Throughput: million env steps per second in 12 episodes, of the rollout alone and of whole
  evaluations; share of the GPU's float32 peak that the automaton's necessary operations take. For
  random genomes with nearly full bodies, and for the published champions with a little noise.
- Parity with the engine ``batched``, which runs in a process beside it: bodies and success that
  differ, largest and mean difference of the episodes' fitness, over 384 genomes, the champions
  among them, in 12 episodes each.
- Throughput of ``make_vec(..., device="cuda")`` with 65,536 environments, resets included.
- Seconds of a generation of each optimizer, split into ask, rollout, and tell with adding to the
  archive; and what the paper's runs would take.

``--quick`` leaves out the larger populations. It exits with 1 if a floor is missed: 60 million
steps per second (LightChase, CarryBall) and 6 million (Obstacle) at a population of 8,192, 50
million in 65,536 environments of LightChase, 10 ms for a generation of CMA-ES in LightChase, and
parity.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from numba import cuda
from numpy.typing import NDArray

from benchmarks.gpu_environments import environments, missed_environments, print_environments
from benchmarks.workload import EPISODES, nca_flops_per_step, nearly_full_genomes
from ncrs.engines.base import CUDA_ENGINE, Evaluation, make_engine
from ncrs.evolution.archive import Archive
from ncrs.evolution.optimizers import OPTIMIZERS, make_optimizer
from ncrs.evolution.optimizers.settings import CMASettings, OptimizerSettings
from ncrs.runs.elites import make_archive
from ncrs.runs.published import champions, load_champion
from ncrs_envs.cuda import gpu
from ncrs_envs.cuda.devices import device_name
from ncrs_envs.scenario import sample_scenarios
from ncrs_envs.tasks import TaskSettings

PAPER_TASKS = ("light_chase", "obstacle", "carry_ball")
POPULATIONS = (112, 1024, 8192)
PARITY_GENOMES = 384
PAPER_GENERATIONS = {"cma_es": 20_000, "cma_me": 60_000}
MIN_STEPS = {"light_chase": 60e6, "obstacle": 6e6, "carry_ball": 60e6}
MAX_GENERATION_S = 0.010
MAX_DIFFERENCE = 1e-9
"""Largest difference of an episode's fitness from the CPU's: rounding, no other path."""
_GENERATIONS = 60
_WARM_UP = 5
_REPEATS = 3
_CORE_FLOPS = 2 * 128
"""Float32 operations per cycle and multiprocessor, since compute capability 8.6; 9.0 has it."""


def champion_like(task: str, count: int, seed: int = 0) -> NDArray[np.float32]:
    """Return the published champions of a task and noisy copies of them, ``(count, N)``."""
    known = [load_champion(name).genome for name in champions() if name.startswith(task)]
    genomes = np.resize(np.stack(known), (count, known[0].size))
    rng = np.random.default_rng(seed)
    sigma = rng.choice([0.002, 0.01], size=(count, 1))
    sigma[: len(known)] = 0.0
    return (genomes + sigma * rng.standard_normal(genomes.shape)).astype(np.float32)


@contextmanager
def timed_launches() -> Iterator[dict[str, float]]:
    """Collect the seconds of each kernel, waiting for its end after every launch."""
    seconds: dict[str, float] = {}
    start_kernel = gpu.Launcher.__call__

    def launch(self: gpu.Launcher, *arguments: Any, **options: Any) -> None:
        cuda.synchronize()
        start = time.perf_counter()
        start_kernel(self, *arguments, **options)
        cuda.synchronize()
        name = self.kernel_name
        seconds[name] = seconds.get(name, 0.0) + time.perf_counter() - start

    with mock.patch.object(gpu.Launcher, "__call__", launch):
        yield seconds


def float32_peak() -> float:
    """Return the float32 operations per second of the GPU at its highest clock."""
    device = cuda.get_current_device()
    return _CORE_FLOPS * device.MULTIPROCESSOR_COUNT * device.CLOCK_RATE * 1e3


def throughput(populations: tuple[int, ...]) -> list[dict[str, Any]]:
    """Measure evaluations of all tasks, populations and kinds of genomes."""
    rows = []
    for task in PAPER_TASKS:
        kinds = {"random": nearly_full_genomes(task), "champion-like": champion_like(task, 1024)}
        scenarios = sample_scenarios(task, 1, EPISODES)
        with make_engine(CUDA_ENGINE, TaskSettings(task)) as engine:
            engine.evaluate(kinds["random"], scenarios)  # compiles
            for kind, few in kinds.items():
                for population in populations:
                    genomes = np.resize(few, (population, few.shape[1]))
                    rows.append(
                        {"task": task, "genomes": kind, "population": population}
                        | _speeds(engine, genomes, scenarios)
                    )
    return rows


def _speeds(engine: Any, genomes: NDArray[np.float32], scenarios: Any) -> dict[str, float]:
    whole, kernels = [], []
    for _ in range(_REPEATS):
        start = time.perf_counter()
        result: Evaluation = engine.evaluate(genomes, scenarios)
        whole.append(time.perf_counter() - start)
        with timed_launches() as seconds:
            engine.evaluate(genomes, scenarios)
        kernels.append(seconds["roll_out"])
    rollout = float(np.median(kernels))
    flops = nca_flops_per_step(result.bodies[result.valid], engine.settings.task.name)
    return {
        "rollout_ms": 1e3 * rollout,
        "rollout_steps_per_s": result.env_steps / rollout,
        "steps_per_s": result.env_steps / float(np.median(whole)),
        "share_of_peak": flops * result.env_steps / rollout / float32_peak(),
    }


def write_reference(folder: Path) -> None:
    """Evaluate the genomes of the parity check with the engine ``batched``."""
    for task in PAPER_TASKS:
        with make_engine("batched", TaskSettings(task)) as engine:
            result = engine.evaluate(
                champion_like(task, PARITY_GENOMES), sample_scenarios(task, 2, EPISODES)
            )
        np.savez(folder / f"{task}.npz", **vars(result))


def parity(folder: Path) -> list[dict[str, Any]]:
    """Compare evaluations with the reference."""
    rows = []
    for task in PAPER_TASKS:
        with make_engine(CUDA_ENGINE, TaskSettings(task)) as engine:
            result = engine.evaluate(
                champion_like(task, PARITY_GENOMES), sample_scenarios(task, 2, EPISODES)
            )
        expected = np.load(folder / f"{task}.npz")
        difference = np.abs(result.episode_fitness - expected["episode_fitness"])
        rows.append(
            {
                "task": task,
                "bodies_differ": int((result.bodies != expected["bodies"]).any(axis=(1, 2)).sum()),
                "success_differs": int((result.success != expected["success"]).sum()),
                "crossed_differs": int((result.crossed != expected["crossed"]).sum()),
                "episodes": difference.size,
                "max_difference": float(difference.max()),
                "mean_difference": float(difference.mean()),
            }
        )
    return rows


def optimizer_settings() -> dict[str, OptimizerSettings]:
    """Return the settings of each optimizer, on the GPU where it can be."""
    made: dict[str, OptimizerSettings] = {}
    for name in sorted(OPTIMIZERS):
        kind = OPTIMIZERS[name].settings
        made[name] = kind(device="cuda") if issubclass(kind, CMASettings) else kind()
    return made


def generations(task: str) -> list[dict[str, Any]]:
    """Time the generations of each optimizer, in LightChase, or of the paper's, from a champion."""
    start = champion_like(task, 1)[0].astype(np.float64)
    settings = TaskSettings(task)
    rows = []
    with make_engine(CUDA_ENGINE, settings) as engine:
        for name, chosen in optimizer_settings().items():
            if task != PAPER_TASKS[0] and name not in PAPER_GENERATIONS:
                continue
            optimizer = make_optimizer(chosen, len(start), np.random.SeedSequence(0))
            archive = make_archive(settings)
            optimizer.attach(archive)
            if name != "map_elites":
                optimizer.start_from(start)
            seconds = np.array(
                [_generation(optimizer, archive, engine, index) for index in range(_GENERATIONS)]
            )
            ask, rollout, tell = seconds[_WARM_UP:].mean(axis=0).tolist()
            rows.append(
                {
                    "optimizer": name,
                    "population": chosen.population,
                    "ask_s": ask,
                    "rollout_s": rollout,
                    "tell_s": tell,
                    "total_s": ask + rollout + tell,
                }
            )
    return rows


def _generation(optimizer: Any, archive: Archive, engine: Any, index: int) -> list[float]:
    scenarios = sample_scenarios(engine.settings.task, index, EPISODES)
    times = [time.perf_counter()]
    genomes = optimizer.ask_in_place()
    cuda.synchronize()
    times.append(time.perf_counter())
    result = engine.evaluate(genomes, scenarios)
    times.append(time.perf_counter())
    added = archive.add(
        genomes,
        result.fitness,
        result.measures,
        result.bodies,
        success=result.success.mean(axis=1),
        standing_still=0.0,
        generation=index,
        seeds=np.zeros((1, 4), dtype=np.int64),
    )
    optimizer.tell(result.fitness, added)
    cuda.synchronize()
    times.append(time.perf_counter())
    return np.diff(times).tolist()


def paper_minutes(rows: list[dict[str, Any]]) -> dict[str, float]:
    """Return the minutes that the paper's runs of each optimizer would take."""
    return {
        row["optimizer"]: row["total_s"] * PAPER_GENERATIONS[row["optimizer"]] / 60.0
        for row in rows
        if row["optimizer"] in PAPER_GENERATIONS
    }


def missed(report: Mapping[str, Any]) -> list[str]:
    """Return a sentence for each floor that is missed."""
    problems = []
    largest = [row for row in report["throughput"] if row["population"] == max(POPULATIONS)]
    for row in largest:
        if row["rollout_steps_per_s"] < MIN_STEPS[row["task"]]:
            problems.append(
                f"{row['task']}, {row['genomes']}: {row['rollout_steps_per_s'] / 1e6:.1f} million "
                f"steps/s, at least {MIN_STEPS[row['task']] / 1e6:.0f} expected"
            )
    for row in report["parity"]:
        differ = row["bodies_differ"] + row["success_differs"] + row["crossed_differs"]
        if differ or row["max_difference"] > MAX_DIFFERENCE:
            problems.append(f"{row['task']} differs from the CPU: {row}")
    for row in report["generations"]["light_chase"]:
        if row["optimizer"] == "cma_es" and row["total_s"] > MAX_GENERATION_S:
            problems.append(
                f"a generation of cma_es takes {1e3 * row['total_s']:.1f} ms, at most "
                f"{1e3 * MAX_GENERATION_S:.0f} expected"
            )
    return problems + missed_environments(report["environments"])


def _print_throughput(rows: list[dict[str, Any]]) -> None:
    print("task         genomes        population  rollout ms  M steps/s   whole  peak share")
    for row in rows:
        print(
            f"{row['task']:12} {row['genomes']:13} {row['population']:11,} "
            f"{row['rollout_ms']:11.2f} {row['rollout_steps_per_s'] / 1e6:10.1f} "
            f"{row['steps_per_s'] / 1e6:7.1f} {row['share_of_peak']:10.1%}"
        )


def _print_generations(report: Mapping[str, list[dict[str, Any]]]) -> None:
    for task, rows in report.items():
        print(f"{task}: ms of a generation    ask  rollout     tell    total")
        for row in rows:
            times = (row[name] for name in ("ask_s", "rollout_s", "tell_s", "total_s"))
            print(f"  {row['optimizer']:12} {row['population']:6}   ", end="")
            print(" ".join(f"{1e3 * value:8.2f}" for value in times))
        minutes = paper_minutes(rows).items()
        print("  the paper's runs: " + ", ".join(f"{k} {v:.1f} min" for k, v in minutes))


def _print_parity(rows: list[dict[str, Any]]) -> None:
    for row in rows:
        print("parity", " ".join(f"{key}={value}" for key, value in row.items()))


def _measure(populations: tuple[int, ...], show: bool) -> dict[str, Any]:
    """Make the report; show each part of it as soon as it is there."""
    start = time.perf_counter()
    report: dict[str, Any] = {"gpu": device_name(0), "peak_tflops": float32_peak() / 1e12}
    parts: list[tuple[str, Callable[[], Any], Callable[[Any], None]]] = [
        ("generations", lambda: {task: generations(task) for task in PAPER_TASKS},
         _print_generations),
        ("throughput", lambda: throughput(populations), _print_throughput),
    ]  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "benchmarks.gpu", "--reference", folder]
        reference = subprocess.Popen(command)

        def compare() -> list[dict[str, Any]]:
            if reference.wait():
                raise RuntimeError("The reference could not be computed.")
            return parity(Path(folder))

        parts.append(("parity", compare, _print_parity))
        parts.append(("environments", environments, print_environments))
        if show:
            print(f"{report['gpu']}; peak {report['peak_tflops']:.1f} TFLOP/s (float32)")
        for name, measure, show_part in parts:
            report[name] = measure()
            if show:
                show_part(report[name])
                sys.stdout.flush()
    report["paper_minutes"] = {
        task: paper_minutes(rows) for task, rows in report["generations"].items()
    }
    report["seconds"] = time.perf_counter() - start
    return report


def main() -> int:
    """Run the benchmark; return 1 if a floor is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--quick", action="store_true", help="leave out the larger populations")
    parser.add_argument("--reference", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.reference is not None:
        write_reference(arguments.reference)
        return 0
    report = _measure(POPULATIONS[:1] if arguments.quick else POPULATIONS, not arguments.json)
    print(json.dumps(report, indent=2) if arguments.json else f"{report['seconds']:.0f} s in all")
    problems = missed(report)
    for problem in problems:
        print(f"missed: {problem}", file=sys.stderr)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
