"""Is it still CMA-ES? Evaluations to target with our sampler and with plain pycma.

    python -m benchmarks.optimizers [--json]

On four functions, from mean 0 with the optimum at 1, sigma 0.3 and pycma's default population, this
counts the evaluations until one has a value of at most 1e-9: medians over the seeds that get there
within 10,000 N evaluations, and how many do. Rosenbrock has a second optimum, at -1 in the first
coordinate, where some end with either sampler. The bar: within 10 % of plain pycma.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import warnings
from collections.abc import Callable, Mapping
from typing import Any

import cma
import numpy as np
import torch
from cma.sigma_adaptation import CMAAdaptSigmaCSA
from numpy.typing import NDArray

from ncrs.optimizers.cma_es import CMAES

Array = NDArray[np.float64]
Function = Callable[[Array], Array]

TARGET = 1e-9
SIGMA = 0.3
MAX_RELATIVE_DIFFERENCE = 0.1
EVALUATIONS_PER_DIMENSION = 10_000
# A population whose values differ by less than this share of the best has converged elsewhere.
FLAT = 1e-12


def sphere(x: Array) -> Array:
    """Sum of squares of ``(P, N)`` about 1."""
    return np.asarray(((x - 1.0) ** 2).sum(axis=1))


def ellipsoid(x: Array) -> Array:
    """Axes with curvatures from 1 to 10^6, evenly on a logarithmic scale."""
    return np.asarray(((x - 1.0) ** 2) @ 10.0 ** np.linspace(0.0, 6.0, x.shape[1]))


def cigar(x: Array) -> Array:
    """One axis with curvature 1, all others 10^6."""
    squares = (x - 1.0) ** 2
    return np.asarray(squares[:, 0] + 1e6 * squares[:, 1:].sum(axis=1))


def rosenbrock(x: Array) -> Array:
    """A bent valley to the optimum at 1."""
    along = (1.0 - x[:, :-1]) ** 2
    across = (x[:, 1:] - x[:, :-1] ** 2) ** 2
    return np.asarray((along + 100.0 * across).sum(axis=1))


FUNCTIONS: Mapping[str, Function] = {
    "sphere": sphere,
    "ellipsoid": ellipsoid,
    "cigar": cigar,
    "rosenbrock": rosenbrock,
}


def default_population(dimension: int) -> int:
    """pycma's default."""
    return 4 + int(3 * math.log(dimension))


def _ours(dimension: int, seed: int, population: int, **settings: Any) -> Any:
    return CMAES(
        dimension,
        np.random.SeedSequence(seed),
        sigma=SIGMA,
        population=population,
        **settings,
    )


class _Plain:
    """Plain pycma behind the same two calls."""

    def __init__(self, dimension: int, seed: int, population: int) -> None:
        generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed)))
        options = {
            "popsize": population,
            "seed": float("nan"),
            "randn": lambda *shape: generator.standard_normal(shape),
            "AdaptSigma": CMAAdaptSigmaCSA,
            "verbose": -9,
            "verb_log": 0,
        }
        self._es = cma.CMAEvolutionStrategy(np.zeros(dimension), SIGMA, options)

    def ask(self) -> Array:
        self._asked = self._es.ask()
        return np.array(self._asked)

    def tell(self, fitness: Array) -> None:
        self._es.tell(self._asked, (-fitness).tolist())


def evaluations_to_target(
    make: Callable[[int, int, int], Any], function: Function, dimension: int, seed: int, budget: int
) -> float:
    """Evaluations until one is at most ``TARGET``; infinite if that is not to be.

    That is, if ``budget`` does not do, or the search has converged to another value.

    Args:
        make: optimizer from dimension, seed and population.
        function: values ``(P,)`` of points ``(P, N)``, minimised.
        dimension: N.
        seed: of the optimizer.
        budget: most evaluations.
    """
    population = default_population(dimension)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        optimizer = make(dimension, seed, population)
    for evaluations in range(population, budget + 1, population):
        values = function(optimizer.ask())
        if values.min() <= TARGET:
            return float(evaluations)
        if np.ptp(values) <= FLAT * abs(values.min()):
            break
        optimizer.tell(-values)
    return math.inf


def compare(function: str, dimension: int, seeds: int, precision: str) -> dict[str, Any]:
    """Evaluations to target of ours and of plain pycma.

    Returns:
        ``ours`` and ``pycma``, medians over the seeds that reach it, ``ours_reached`` and
        ``pycma_reached``, how many do, ``ratio`` of the medians, and whether the bar is ``met``.
        Medians and ratio are None if no seed reaches it.
    """
    budget = EVALUATIONS_PER_DIMENSION * dimension

    def ours(dimension: int, seed: int, population: int) -> Any:
        return _ours(dimension, seed, population, precision=precision)

    runs = {
        name: [
            evaluations_to_target(make, FUNCTIONS[function], dimension, seed, budget)
            for seed in range(seeds)
        ]
        for name, make in (("ours", ours), ("pycma", _Plain))
    }
    reached = {name: [run for run in of if math.isfinite(run)] for name, of in runs.items()}
    medians = {name: float(np.median(of)) if of else None for name, of in reached.items()}
    mine, theirs = medians["ours"], medians["pycma"]
    ratio = None if mine is None or theirs is None else mine / theirs
    return {
        "function": function,
        "dimension": dimension,
        "seeds": seeds,
        **medians,
        **{f"{name}_reached": len(of) for name, of in reached.items()},
        "ratio": ratio,
        "met": ratio is not None and ratio <= 1.0 + MAX_RELATIVE_DIFFERENCE,
    }


def _line(row: dict[str, Any]) -> str:
    """One line of the printed table."""
    line = f"{row['function']:<12}{row['dimension']:>5}{row['seeds']:>7}"
    for name in ("ours", "pycma"):
        median = "-" if row[name] is None else f"{row[name]:.0f}"
        line += f"{median:>10} ({row[f'{name}_reached']:>3})"
    return line + ("       -" if row["ratio"] is None else f"{row['ratio']:>8.3f}")


def main(arguments: list[str] | None = None) -> int:
    """Run the comparison; returns 1 if a bar is missed."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--json", action="store_true", help="print one JSON list")
    parser.add_argument("--dimensions", type=int, nargs="+", default=[40, 200])
    parser.add_argument("--functions", nargs="+", default=list(FUNCTIONS), choices=list(FUNCTIONS))
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--precision", default="float32", choices=["float32", "float64"])
    options = parser.parse_args(arguments)
    torch.set_num_threads(1)  # at these sizes threads wait longer than they compute
    results = []
    if not options.json:
        print(f"{'function':<12}{'N':>5}{'seeds':>7}{'ours':>16}{'pycma':>16}{'ratio':>8}")
    for dimension in options.dimensions:
        for function in options.functions:
            row = compare(function, dimension, options.seeds, options.precision)
            results.append(row)
            if not options.json:
                print(_line(row), flush=True)
    if options.json:
        print(json.dumps(results, indent=2))
    return 0 if all(row["met"] for row in results) else 1


if __name__ == "__main__":
    sys.exit(main())
