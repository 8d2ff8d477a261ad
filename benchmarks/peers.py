"""Speed beside comparable packages, in one run: ``python -m benchmarks.peers``.

- Steps per second of single environments with random actions, automatic resets included, beside
  Gymnasium's ``LunarLander-v3``, which uses Box2D too: medians of turns, and of their ratios.
- Milliseconds of ask and tell at the size of the paper's search, 4,572 weights and a population of
  112, beside pycma, pyribs and EvoTorch; medians. Each package has a process of its own, so that
  none finds memory that another has left. EvoTorch's full covariance takes ten seconds a generation
  and is left out.

Needs the extra ``peers``; what is not installed is left out, and said so. ``--json`` prints
``{"environments": {id: {"steps_per_s", "ratio"}}, "optimizers": {kind: {package: ms}}}``.
"""

from __future__ import annotations

import argparse
import importlib
import json
import logging
import multiprocessing
import time
import warnings
from collections.abc import Callable, Mapping
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from ncrs.evolution.optimizers import OPTIMIZERS, make_optimizer
from ncrs.evolution.optimizers.pycma import cma
from ncrs_envs.tasks import PAPER_TASKS

LUNAR_LANDER = "LunarLander-v3"
DIMENSION, POPULATION, SIGMA = 4572, 112, 0.03
_STEPS = 2000
_TURNS = 9
_GENERATIONS = {"separable": 30, "full": 10}
"""Numbers of generations; the full covariance is factorised every few of them."""

Genomes = NDArray[np.float64]
Step = Callable[[], None]


def _fitness(genomes: Genomes) -> NDArray[np.float64]:
    # Without an array of squares, which takes as long to make as some of what is measured.
    values: NDArray[np.float64] = -np.einsum("ij,ij->i", genomes, genomes)
    return values


def environment_speed(env_id: str) -> float:
    """Measure steps per second of CPU time with random actions."""
    env = gymnasium.make(env_id)
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(64)]
    start = time.process_time()
    for step in range(_STEPS):
        _, _, terminated, truncated, _ = env.step(actions[step % 64])
        if terminated or truncated:
            env.reset()
    seconds = time.process_time() - start
    env.close()
    return _STEPS / seconds


def environments(turns: int) -> dict[str, dict[str, float]]:
    """Measure the environments in turns."""
    names = [LUNAR_LANDER, *(task.env_id for task in PAPER_TASKS)]
    speeds: dict[str, list[float]] = {name: [] for name in names}
    for name in names:
        environment_speed(name)  # imports
    for _ in range(turns):
        for name in names:
            speeds[name].append(environment_speed(name))
    base = np.array(speeds[LUNAR_LANDER])
    return {
        name: {
            "steps_per_s": float(np.median(values)),
            "ratio": float(np.median(np.array(values) / base)),
        }
        for name, values in speeds.items()
    }


def _ours(name: str) -> Step:
    optimizer = make_optimizer(
        OPTIMIZERS[name].settings(sigma=SIGMA, population=POPULATION),
        DIMENSION,
        np.random.SeedSequence(0),
    )
    return lambda: optimizer.tell(_fitness(optimizer.ask()))


def _pycma(diagonal: bool) -> Step:
    options = {"popsize": POPULATION, "CMA_diagonal": diagonal, "verbose": -9, "seed": 1}
    strategy = cma.CMAEvolutionStrategy(np.zeros(DIMENSION), SIGMA, options)

    def step() -> None:
        genomes = strategy.ask()
        strategy.tell(genomes, (-_fitness(np.array(genomes))).tolist())

    return step


def _pyribs(name: str) -> Step:
    strategies: Any = importlib.import_module("ribs.emitters.opt")
    strategy = getattr(strategies, name)(SIGMA, DIMENSION, POPULATION, seed=0)
    strategy.reset(np.zeros(DIMENSION))

    def step() -> None:
        fitness = _fitness(strategy.ask())
        strategy.tell(np.argsort(-fitness), fitness[:, None], POPULATION // 2)

    return step


def _evotorch() -> Step:
    logging.getLogger("evotorch").setLevel(logging.WARNING)
    torch, evotorch = importlib.import_module("torch"), importlib.import_module("evotorch")
    algorithms: Any = importlib.import_module("evotorch.algorithms")
    problem = evotorch.Problem(
        "max",
        lambda genomes: -torch.einsum("ij,ij->i", genomes, genomes),
        solution_length=DIMENSION,
        initial_bounds=(-1e-9, 1e-9),
        dtype=torch.float64,
        vectorized=True,
        seed=1,
    )
    search = algorithms.CMAES(problem, popsize=POPULATION, stdev_init=SIGMA, separable=True)
    step: Step = search.step
    return step


SEARCHES: Mapping[str, Mapping[str, Callable[[], Step]]] = {
    "separable": {
        "ncrs": lambda: _ours("sep_cma_es"),
        "pycma": lambda: _pycma(True),
        "pyribs": lambda: _pyribs("SeparableCMAEvolutionStrategy"),
        "evotorch": _evotorch,
    },
    "full": {
        "ncrs": lambda: _ours("cma_es"),
        "pycma": lambda: _pycma(False),
        "pyribs": lambda: _pyribs("CMAEvolutionStrategy"),
    },
}


def search_time(kind: str, package: str) -> float | None:
    """Measure milliseconds of ask and tell; None if the package is not installed.

    The mean of a full covariance's generations counts: it is factorised in some of them only.
    """
    warnings.simplefilter("ignore")
    try:
        step = SEARCHES[kind][package]()
    except ModuleNotFoundError:
        return None
    step()
    times = []
    for _ in range(_GENERATIONS[kind]):
        start = time.perf_counter()
        step()
        times.append(1000.0 * (time.perf_counter() - start))
    return float(np.mean(times) if kind == "full" else np.median(times))


def optimizers() -> dict[str, dict[str, float | None]]:
    """Measure ask and tell of all packages, each in its own process."""
    with multiprocessing.get_context("spawn").Pool(1, maxtasksperchild=1) as pool:
        return {
            kind: {package: pool.apply(search_time, (kind, package)) for package in searches}
            for kind, searches in SEARCHES.items()
        }


def main() -> None:
    """Read the command line, measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--turns", type=int, default=_TURNS, help="turns of the environments")
    options = parser.parse_args()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = {"environments": environments(options.turns), "optimizers": optimizers()}
    if options.json:
        print(json.dumps(result))
        return
    print(f"{'environment':22} {'steps/s':>9} {'of LunarLander':>15}")
    for name, speed in result["environments"].items():
        print(f"{name:22} {speed['steps_per_s']:>9,.0f} {speed['ratio']:>15.2f}")
    for kind, times in result["optimizers"].items():
        print(f"\nask and tell, {kind} covariance")
        for package, spent in times.items():
            print(f"{package:22} {'not installed' if spent is None else f'{spent:.1f} ms':>15}")


if __name__ == "__main__":
    main()
