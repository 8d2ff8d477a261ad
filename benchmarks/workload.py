"""Workloads to time: genomes that grow nearly full bodies, and clocks for them."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import HIDDEN_UNITS, STEPS_PER_ACTION, nca_layout
from ncrs.automaton.growth import grow
from ncrs.automaton.nca import NCAPopulation
from ncrs.engines.base import make_engine
from ncrs.runs.engine_settings import EngineSettings
from ncrs_envs.scenario import sample_scenarios
from ncrs_envs.tasks import TASKS, TaskSettings

POPULATION = 112
EPISODES = 12
_SIGMA = 0.1
_MIN_OCCUPIED = 0.88
"""Minimum fraction of the cells that a nearly full body occupies: 22 of 25."""
_BATCH = 512
_MAX_DRAWS = 200


def nearly_full_genomes(
    task: str, count: int = POPULATION, grid_size: int = 5, seed: int = 0
) -> NDArray[np.float32]:
    """Draw genomes whose bodies are valid and nearly full, ``(count, N)``.

    Raises:
        RuntimeError: If a reasonable number of draws has too few.
    """
    layout = nca_layout(task)
    rng = np.random.default_rng(seed)
    found: list[NDArray[np.float32]] = []
    for _ in range(_MAX_DRAWS):
        drawn = rng.normal(0.0, _SIGMA, (_BATCH, layout.num_parameters)).astype(np.float32)
        bodies = grow(NCAPopulation(drawn, task), grid_size)
        full = (bodies != 0).mean(axis=(1, 2)) >= _MIN_OCCUPIED
        found += list(drawn[full & TASKS[task].is_valid(bodies)])
        if len(found) >= count:
            return np.stack(found[:count])
    raise RuntimeError(f"Only {len(found)} of {count} nearly full {task} bodies were found.")


def rollout_speed(
    engine: EngineSettings,
    task: TaskSettings,
    genomes: NDArray[np.float32],
    *,
    episodes: int = EPISODES,
    repeats: int = 5,
) -> float:
    """Measure environment steps per second of whole evaluations, NCA included: median."""
    scenarios = sample_scenarios(task.task, 1, episodes, task.grid_size)
    with make_engine(engine.name, task, engine.workers) as running:
        steps = running.evaluate(genomes, scenarios).env_steps  # compiles, starts workers
        seconds = median_seconds(lambda: running.evaluate(genomes, scenarios), repeats)
    return steps / seconds


def median_seconds(work: Callable[[], Any], repeats: int) -> float:
    """Measure the wall-clock time of a call in seconds: median."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return float(np.median(times))


def nca_flops_per_step(bodies: NDArray[np.int8], task: str) -> float:
    """Count the NCA's floating-point operations in one environment step, averaged over bodies.

    Only necessary ones count: those of occupied neighbours, and of channels that change.
    """
    occupied = np.pad(bodies != 0, ((0, 0), (1, 1), (1, 1)))
    n = bodies.shape[-1]
    neighbours = sum(
        occupied[:, row : row + n, column : column + n] for row in range(3) for column in range(3)
    )
    links = float((neighbours * (bodies != 0)).sum() / len(bodies))
    cells = float((bodies != 0).sum() / len(bodies))
    layout = nca_layout(task)
    changing = layout.changing_channels.stop - layout.changing_channels.start
    dense = HIDDEN_UNITS * (HIDDEN_UNITS + changing)
    products = links * changing * HIDDEN_UNITS + cells * dense
    return 2.0 * STEPS_PER_ACTION * products


def gemm_gflops(size: int = 2048, repeats: int = 5) -> float:
    """Measure a large float32 matrix product on all cores: the processor's practical peak."""
    rng = np.random.default_rng(0)
    a, b = (rng.random((size, size), dtype=np.float32) for _ in range(2))
    a @ b
    return 2.0 * size**3 / median_seconds(lambda: a @ b, repeats) / 1e9
