"""Environment steps per second of every engine and task: ``python -m benchmarks.throughput``.

The workload is the paper's generation: 112 genomes with nearly full 5 x 5 bodies, 12 episodes of
100 steps, NCA and contacts included; for ``vector``, 4,096 environments stepped through
``gymnasium.make_vec`` with random actions, including their automatic resets. Engines take turns
within each task, so that ratios hold on a noisy machine. ``--json`` prints one object:
``{engine: {task: env_steps_per_s}, "vector": {task: ...}, "gemm_gflops": ...}``.
"""

from __future__ import annotations

import argparse
import json
from typing import Any

import gymnasium
import numpy as np

import ncrs_envs  # noqa: F401 - registers the environments
from benchmarks.workload import (
    POPULATION,
    gemm_gflops,
    median_seconds,
    nca_flops_per_step,
    nearly_full_genomes,
    rollout_speed,
)
from ncrs.automaton.growth import grow
from ncrs.automaton.nca import NCAPopulation
from ncrs.engines.base import usable_engines
from ncrs.runs.engine_settings import EngineSettings
from ncrs_envs.cores import available_cores
from ncrs_envs.tasks import PAPER_TASKS, TASKS, TaskSettings

AUTHORS_STEPS_PER_S_AND_CORE = 140
"""Speed of the published implementation on the machine where this was written."""
_BOX2D_GENOMES = 12
_VECTOR_ENVS = 4096
_VECTOR_STEPS = 250
"""Number of steps: two and a half episodes, so that resets count."""
NAMES = tuple(task.name for task in PAPER_TASKS)


def vector_speed(
    task: str, repeats: int, envs: int = _VECTOR_ENVS, steps: int = _VECTOR_STEPS
) -> float:
    """Measure environment steps per second of ``make_vec`` with fixed random actions: median."""
    vector = gymnasium.make_vec(TASKS[task].env_id, num_envs=envs)
    vector.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1, 1, vector.action_space.shape)
    actions = actions.astype(np.float32)
    for _ in range(3):
        vector.step(actions)

    def run() -> None:
        for _ in range(steps):
            vector.step(actions)

    seconds = median_seconds(run, repeats)
    vector.close()
    return envs * steps / seconds


def measure(repeats: int) -> dict[str, Any]:
    """Measure all figures."""
    result: dict[str, Any] = {engine: {} for engine in usable_engines()}
    result["vector"] = {}
    result["gemm_gflops"] = gemm_gflops()
    for task in NAMES:
        genomes = nearly_full_genomes(task)
        for engine in usable_engines():
            chosen = genomes[:_BOX2D_GENOMES] if engine == "box2d" else genomes
            result[engine][task] = rollout_speed(
                EngineSettings(engine), TaskSettings(task), chosen, repeats=repeats
            )
        result["vector"][task] = vector_speed(task, repeats)
    return result


def _table(result: dict[str, Any]) -> str:
    cores = available_cores()
    lines = [
        f"{cores} cores, large float32 matrix product {result['gemm_gflops']:.0f} GFLOP/s",
        "",
        f"{'env steps/s':<12}" + "".join(f"{task:>14}" for task in NAMES),
    ]
    for name in (*usable_engines(), "vector"):
        lines.append(f"{name:<12}" + "".join(f"{result[name][t]:>14,.0f}" for t in NAMES))
    authors = AUTHORS_STEPS_PER_S_AND_CORE * cores
    ratio = [result["batched"][t] / result["box2d"][t] for t in NAMES]
    lines += [
        "",
        "batched / box2d".ljust(20) + "".join(f"{value:>10.0f} x" for value in ratio),
        f"batched / published code ({AUTHORS_STEPS_PER_S_AND_CORE} steps/s and core): "
        + ", ".join(f"{result['batched'][t] / authors:,.0f} x" for t in NAMES),
        "box2d per core: " + ", ".join(f"{result['box2d'][t] / cores:,.0f}" for t in NAMES),
    ]
    for task in NAMES:
        bodies = grow(NCAPopulation(nearly_full_genomes(task, 32), task))
        gflops = result["batched"][task] * nca_flops_per_step(bodies, task) / 1e9
        lines.append(
            f"batched, {task}: the NCA alone is {gflops:.0f} GFLOP/s, "
            f"{gflops / result['gemm_gflops']:.0%} of the matrix product's speed"
        )
    return "\n".join(lines)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--repeats", type=int, default=5, help="default: %(default)s")
    options = parser.parse_args()
    result = measure(options.repeats)
    print(json.dumps(result) if options.json else f"{POPULATION} genomes\n{_table(result)}")


if __name__ == "__main__":
    main()
