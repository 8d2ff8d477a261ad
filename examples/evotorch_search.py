"""EvoTorch on the batched engine: its separable CMA-ES evolves the weights.

Needs ``pip install evotorch``. It grows and drives robots as training does, with EvoTorch in place
of our optimizers:

    python examples/evotorch_search.py
"""

from __future__ import annotations

import argparse
import csv
import time
from pathlib import Path

import torch
from evotorch import Problem, SolutionBatch
from evotorch.algorithms import CMAES

import ncrs
from ncrs.automaton.channels import nca_layout
from ncrs_envs.mirroring import ScenarioSampling

POPULATION = 112
GENERATIONS = 600
SIGMA = 0.03


class Chase(Problem):
    """Fitness of symmetric genomes in LightChase, in new scenarios in every generation."""

    def __init__(self, seed: int) -> None:
        self.layout = nca_layout("light_chase")
        super().__init__(
            "max", solution_length=self.layout.num_parameters, initial_bounds=(-1e-9, 1e-9),
            dtype=torch.float64, seed=seed,
        )  # fmt: skip
        self._seed, self._generation = seed, 0

    def genomes(self, values: torch.Tensor) -> torch.Tensor:
        """Project onto genomes that treat left and right alike, which steer sooner."""
        return torch.from_numpy(self.layout.symmetric(values.numpy()))

    def _evaluate_batch(self, batch: SolutionBatch) -> None:
        sampling = ScenarioSampling("front_back")
        scenarios = sampling.draw("light_chase", [self._seed, self._generation], 6)
        self._generation += 1
        genomes = self.genomes(batch.values).numpy()
        result = ncrs.evaluate(genomes, "light_chase", scenarios=scenarios)
        batch.set_evals(torch.from_numpy(result.fitness))


def search(generations: int, seed: int, curve: Path | None = None) -> torch.Tensor:
    """Search, and return the genome at the middle of the distribution."""
    problem = Chase(seed)
    searcher = CMAES(problem, popsize=POPULATION, stdev_init=SIGMA, separable=True)
    rows, start = [], time.perf_counter()
    for generation in range(generations):
        searcher.step()
        best = float(searcher.status["pop_best_eval"])
        rows.append((generation, time.perf_counter() - start, best, searcher.status["mean_eval"]))
        if (generation + 1) % max(1, generations // 20) == 0:
            print(f"generation {generation + 1:5}  best {best:.3f}", flush=True)
    if curve is not None:
        with curve.open("w", newline="", encoding="utf-8") as stream:
            csv.writer(stream).writerows([("generation", "seconds", "best", "mean"), *rows])
    return problem.genomes(searcher.status["center"][None].to(torch.float64))


def main() -> None:
    """Read the command line, search, and test."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--generations", type=int, default=GENERATIONS)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--curve", type=Path, help="CSV file for the learning curve")
    options = parser.parse_args()
    genome = search(options.generations, options.seed, options.curve)
    result = ncrs.evaluate(genome.numpy(), "light_chase", episodes=1000, seed=1_000_000)
    print(f"fitness {result.fitness[0]:.3f}, success {result.success.mean():.1%} of 1,000 episodes")


if __name__ == "__main__":
    main()
