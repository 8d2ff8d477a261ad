"""Evaluations to target with our sampler and with plain pycma: is it still CMA-ES?

    python -m benchmarks.optimizers [--json] [--functions NAME ...] [--dimensions N ...] [--seeds S]

On four functions, from mean 0 with the optimum at 1, sigma 0.3 and pycma's default population, this
counts the evaluations until one has a value of at most 1e-9. Figures are medians over seeds; a
search that does not get there within 10,000 N evaluations counts as infinite. Rosenbrock has a
second optimum, with -1 in the first coordinate and the value 4, in which some searches end with
either sampler; those are counted apart. The bar: within 10 % of plain pycma.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import cma
import numpy as np
import torch
from cma.sigma_adaptation import CMAAdaptSigmaCSA
from numpy.typing import NDArray

from ncrs.evolution.optimizers import CMAESSettings
from ncrs.evolution.optimizers.cma_es import CMAES

Array = NDArray[np.float64]
Function = Callable[[Array], Array]

TARGET = 1e-9
SIGMA = 0.3
MAX_RELATIVE_DIFFERENCE = 0.1
EVALUATIONS_PER_DIMENSION = 10_000
# A population whose values differ by less than this fraction of the best has converged elsewhere.
FLAT = 1e-12


def sphere(x: Array) -> Array:
    """Sum the squares of ``(P, N)`` about 1."""
    return np.asarray(((x - 1.0) ** 2).sum(axis=1))


def ellipsoid(x: Array) -> Array:
    """Compute an ellipsoid: curvatures from 1 to 10^6, evenly on a logarithmic scale."""
    return np.asarray(((x - 1.0) ** 2) @ 10.0 ** np.linspace(0.0, 6.0, x.shape[1]))


def cigar(x: Array) -> Array:
    """Compute a cigar: one axis with curvature 1, all others with 10^6."""
    squares = (x - 1.0) ** 2
    return np.asarray(squares[:, 0] + 1e6 * squares[:, 1:].sum(axis=1))


def rosenbrock(x: Array) -> Array:
    """Compute Rosenbrock's function: a bent valley to the optimum at 1."""
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
    """Return pycma's default population."""
    return 4 + int(3 * math.log(dimension))


def _ours(dimension: int, seed: int, population: int, **settings: Any) -> Any:
    record = CMAESSettings(sigma=SIGMA, population=population, **settings)
    return CMAES(dimension, np.random.SeedSequence(seed), record)


class PlainPycma:
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
        """Propose a population, ``(P, N)``."""
        self._asked = self._es.ask()
        return np.array(self._asked)

    def tell(self, fitness: Array) -> None:
        """Learn from the fitness ``(P,)`` of the last population."""
        self._es.tell(self._asked, (-fitness).tolist())


@dataclass(frozen=True)
class Search:
    """End of a search for the target."""

    evaluations: float
    """Number of evaluations until a value was at most ``TARGET``; infinite if none was."""
    best: Array
    """Best point of the last population, ``(N,)``."""


def search(
    make: Callable[[int, int, int], Any], function: Function, dimension: int, seed: int, budget: int
) -> Search:
    """Search until a value is at most ``TARGET``, or all are the same, or ``budget`` is spent.

    Args:
        make: Function that makes an optimizer from dimension, seed and population.
        function: Function to minimise: values ``(P,)`` of points ``(P, N)``.
        dimension: Dimension N.
        seed: Seed of the optimizer.
        budget: Maximum number of evaluations.
    """
    population = default_population(dimension)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        optimizer = make(dimension, seed, population)
    best = np.zeros(dimension)
    for evaluations in range(population, budget + 1, population):
        points = optimizer.ask()
        values = function(points)
        best = points[int(values.argmin())].copy()
        if values.min() <= TARGET:
            return Search(float(evaluations), best)
        if np.ptp(values) <= FLAT * abs(values.min()):
            break
        optimizer.tell(-values)
    return Search(math.inf, best)


def is_elsewhere(function: str, found: Search) -> bool:
    """Check whether a search of that function ended in its other optimum."""
    return function == "rosenbrock" and math.isinf(found.evaluations) and found.best[0] < 0.0


def compare(function: str, dimension: int, seeds: int, precision: str) -> dict[str, Any]:
    """Compare the evaluations to target of ours and of plain pycma.

    Returns:
        ``ours`` and ``pycma``: medians over the seeds that did not end in another optimum, None if
        infinite. ``ours_elsewhere`` and ``pycma_elsewhere``: number of seeds that did. ``ratio``:
        ratio of the medians, None without both. ``met``: True if the bar is met.
    """
    budget = EVALUATIONS_PER_DIMENSION * dimension

    def ours(dimension: int, seed: int, population: int) -> Any:
        return _ours(dimension, seed, population, precision=precision)

    medians: dict[str, float] = {}
    elsewhere: dict[str, int] = {}
    for name, make in (("ours", ours), ("pycma", PlainPycma)):
        runs = [search(make, FUNCTIONS[function], dimension, seed, budget) for seed in range(seeds)]
        counted = [run.evaluations for run in runs if not is_elsewhere(function, run)]
        medians[name] = float(np.median(counted)) if counted else math.inf
        elsewhere[f"{name}_elsewhere"] = seeds - len(counted)
    is_finite = all(math.isfinite(median) for median in medians.values())
    ratio = medians["ours"] / medians["pycma"] if is_finite else None
    return {
        "function": function,
        "dimension": dimension,
        "seeds": seeds,
        **{name: median if math.isfinite(median) else None for name, median in medians.items()},
        **elsewhere,
        "ratio": ratio,
        "met": ratio is not None and ratio <= 1.0 + MAX_RELATIVE_DIFFERENCE,
    }


def _line(row: dict[str, Any]) -> str:
    """Format one line of the printed table."""
    line = f"{row['function']:<12}{row['dimension']:>5}{row['seeds']:>7}"
    for name in ("ours", "pycma"):
        median = "-" if row[name] is None else f"{row[name]:.0f}"
        line += f"{median:>10}{row[f'{name}_elsewhere']:>10}"
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
        names = "".join(f"{name:>10}{'elsewhere':>10}" for name in ("ours", "pycma"))
        print(f"{'function':<12}{'N':>5}{'seeds':>7}{names}{'ratio':>8}")
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
