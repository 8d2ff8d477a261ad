"""Speed of the batched engine by size of the problem: ``python -m benchmarks.scaling [--json]``.

Environment steps per second of LightChase with nearly full bodies, NCA included, against threads,
population, episodes and grid size, and the peak memory of a process that evaluates the paper's
generation (112 genomes x 12 episodes x 100 steps).
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.workload import EPISODES, POPULATION, nearly_full_genomes, rollout_speed
from ncrs.runs.engine_settings import EngineSettings
from ncrs_envs.cores import available_cores
from ncrs_envs.tasks import TaskSettings

TASK = "light_chase"
POPULATIONS = (1, 8, 29, POPULATION, 448)
EPISODE_COUNTS = (1, 3, 6, EPISODES, 24, 100)
GRID_SIZES = (3, 5, 7, 9, 15)
_LARGE_POPULATION = 24
"""Number of genomes for each grid size; larger bodies take longer."""


def measure(repeats: int) -> dict[str, Any]:
    """Measure environment steps per second by the value of each quantity, and memory in GB."""
    genomes = nearly_full_genomes(TASK, max(POPULATIONS))
    paper = genomes[:POPULATION]

    def speed(
        genomes: NDArray[np.float32] = paper,
        workers: int | None = None,
        episodes: int = EPISODES,
        grid_size: int = 5,
    ) -> float:
        engine, task = EngineSettings("batched", workers), TaskSettings(TASK, grid_size)
        return rollout_speed(engine, task, genomes, episodes=episodes, repeats=repeats)

    return {
        "threads": {n: speed(workers=n) for n in range(1, available_cores() + 1)},
        "population": {n: speed(genomes[:n]) for n in POPULATIONS},
        "episodes": {n: speed(episodes=n) for n in EPISODE_COUNTS},
        "grid_size": {
            n: speed(nearly_full_genomes(TASK, _LARGE_POPULATION, n), grid_size=n)
            for n in GRID_SIZES
        },
        "peak_memory_gb": _peak_memory_gb(),
    }


def _evaluate_paper_generation() -> None:
    genomes = nearly_full_genomes(TASK)
    rollout_speed(EngineSettings("batched"), TaskSettings(TASK), genomes, repeats=1)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(peak / (1e9 if sys.platform == "darwin" else 1e6))


def _peak_memory_gb() -> float:
    """Measure the peak memory of a new process, in 10^9 bytes; kernels come compiled from disk."""
    command = "from benchmarks.scaling import _evaluate_paper_generation as f; f()"
    done = subprocess.run([sys.executable, "-c", command], capture_output=True, check=True)
    return float(done.stdout)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--repeats", type=int, default=5, help="default: %(default)s")
    options = parser.parse_args()
    result = measure(options.repeats)
    if options.json:
        print(json.dumps(result))
        return
    print(f"batched, {TASK}, nearly full bodies; env steps/s\n")
    for quantity in ("threads", "population", "episodes", "grid_size"):
        print(quantity)
        for value, speed in result[quantity].items():
            print(f"  {value:>5} {speed:>12,.0f}")
    print(f"peak memory at the paper's size: {result['peak_memory_gb']:.2f} GB")


if __name__ == "__main__":
    main()
