"""Milliseconds to draw and prepare the scenarios of a generation: ``python -m benchmarks.drawing``.

Each genome has 12 scenarios of its own (``common_scenarios=false``), as in the paper's runs. They
are drawn, converted for the simulator, and scored for a robot that stands still, one by one and
at once. ``--json`` prints ``{population: {task: {"one_by_one_ms", "at_once_ms"}}}``.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable

import numpy as np

from ncrs.engines.arguments import ScenarioRows, check_scenario_rows
from ncrs.engines.batched import scenario_table
from ncrs.evolution.standstill import standing_still_fitness
from ncrs_envs.batched.drawing import draw_rows
from ncrs_envs.drawing import draw_scenarios
from ncrs_envs.mirroring import ScenarioSampling
from ncrs_envs.tasks import PAPER_TASKS, TaskSettings

EPISODES = 12
POPULATIONS = (112, 8192)
_SAMPLING = ScenarioSampling()


def milliseconds(draw: Callable[[], ScenarioRows], settings: TaskSettings, repeats: int) -> float:
    """Measure the minimum time of drawing and of what follows from the drawn rows."""
    best = np.inf
    for _ in range(repeats):
        start = time.perf_counter()
        rows = check_scenario_rows(drawn := draw(), settings, len(drawn))
        scenario_table(rows, settings.grid_size)
        standing_still_fitness(settings, rows)
        best = min(best, 1000.0 * (time.perf_counter() - start))
    return float(best)


def measure(population: int, task: str, repeats: int) -> dict[str, float]:
    """Measure both ways for a population."""
    settings = TaskSettings(task)
    keys = [(0, 0, genome) for genome in range(population)]

    def one_by_one() -> ScenarioRows:
        seeds = [np.random.SeedSequence(0, spawn_key=key) for key in keys]
        return [draw_scenarios(_SAMPLING, settings, seed, EPISODES) for seed in seeds]

    def at_once() -> ScenarioRows:
        return draw_rows(_SAMPLING, settings, 0, keys, EPISODES)

    at_once()  # compiles
    return {
        "one_by_one_ms": milliseconds(one_by_one, settings, 1 if population > 1000 else repeats),
        "at_once_ms": milliseconds(at_once, settings, repeats),
    }


def main() -> None:
    """Read the command line, measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    names = [task.name for task in PAPER_TASKS]
    result = {
        population: {name: measure(population, name, options.repeats) for name in names}
        for population in POPULATIONS
    }
    if options.json:
        print(json.dumps(result))
        return
    print(f"{'population':>10}  {'task':12} {'one by one':>12} {'at once':>10}")
    for population, tasks in result.items():
        for name, times in tasks.items():
            one, all_ = times["one_by_one_ms"], times["at_once_ms"]
            print(f"{population:>10}  {name:12} {one:>9.1f} ms {all_:>7.1f} ms")


if __name__ == "__main__":
    main()
