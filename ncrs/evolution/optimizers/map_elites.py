"""MAP-Elites: variation of random elites, without a model of where to search.

Source: Mouret and Clune 2015; the iso+line operator is that of Vassiliades and Mouret 2018.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from ncrs.evolution.archive import AddResult
from ncrs.evolution.optimizers.base import Fitness, Genomes, OptimizerError, State
from ncrs.evolution.optimizers.quality_diversity import QDOptimizer


class MAPElites(QDOptimizer):
    """MAP-Elites with iso+line variation and sparse mutations of mixed size.

    The first ``initial_genomes`` genomes are normal around 0 (zeros themselves grow no valid
    body); more follow while the archive is empty. After that every genome is the child of a
    random elite, by one of two operators:

    - iso+line: ``x_i + iso_sigma N(0, I) + line_sigma N(0, 1) (x_j - x_i)`` for two elites (their
      equation 1);
    - sparse: a random share of the weights gets normal noise. The share is log-uniform from one
      weight to all, the noise's size log-uniform from ``sparse_sigma_min`` to
      ``sparse_sigma_max``, both drawn anew for each child: no single size of step suits both
      growth, which one weight can change, and control.

    Args:
        dimension: length N of a genome.
        seed: of the optimizer's generator.
        population: genomes per generation.
        initial_sigma: standard deviation of the first genomes.
        initial_genomes: how many are drawn before variation begins.
        iso_sigma, line_sigma: of the iso+line operator.
        sparse_fraction: share of the children that the sparse operator makes, 0 to 1.
        sparse_sigma_min, sparse_sigma_max: range of its noise.
    """

    name: ClassVar[str] = "map_elites"

    def __init__(
        self,
        dimension: int,
        seed: np.random.SeedSequence,
        *,
        population: int = 128,
        initial_sigma: float = 0.1,
        initial_genomes: int = 1024,
        iso_sigma: float = 0.01,
        line_sigma: float = 0.2,
        sparse_fraction: float = 0.5,
        sparse_sigma_min: float = 0.01,
        sparse_sigma_max: float = 1.0,
    ) -> None:
        super().__init__(dimension, seed)
        if population < 1:
            raise OptimizerError(f"population must be at least 1, got {population!r}.")
        if initial_genomes < 0:
            raise OptimizerError(f"initial_genomes must not be negative, got {initial_genomes!r}.")
        if not 0.0 <= sparse_fraction <= 1.0:
            raise OptimizerError(f"sparse_fraction must be from 0 to 1, got {sparse_fraction!r}.")
        self._population = int(population)
        self._initial_genomes = int(initial_genomes)
        self._sparse_share = float(sparse_fraction)
        self._sigmas = {
            "initial_sigma": initial_sigma,
            "iso_sigma": iso_sigma,
            "line_sigma": line_sigma,
            "sparse_sigma_min": sparse_sigma_min,
            "sparse_sigma_max": sparse_sigma_max,
        }
        for name, value in self._sigmas.items():
            if not (math.isfinite(value) and value > 0):
                raise OptimizerError(f"{name} must be positive and finite, got {value!r}.")
        if sparse_sigma_min > sparse_sigma_max:
            raise OptimizerError(
                f"sparse_sigma_min={sparse_sigma_min!r} must not be larger than "
                f"sparse_sigma_max={sparse_sigma_max!r}."
            )
        self._told = 0

    @property
    def settings(self) -> dict[str, Any]:
        return {
            "population": self._population,
            "initial_genomes": self._initial_genomes,
            "sparse_fraction": self._sparse_share,
            **self._sigmas,
        }

    def metrics(self) -> dict[str, float]:
        return {"initial": float(self._told < self._initial_genomes)}

    def _ask(self) -> Genomes:
        size = (self._population, self.dimension)
        if self._told < self._initial_genomes or not len(self._archive):
            return self._sigmas["initial_sigma"] * self._generator.standard_normal(size)
        sparse = int(self._generator.binomial(self._population, self._sparse_share))
        return np.concatenate(
            [self._sparse_children(sparse), self._line_children(self._population - sparse)]
        )

    def _line_children(self, count: int) -> Genomes:
        generator = self._generator
        parents = self._archive.draw(generator, count)
        others = self._archive.draw(generator, count)
        isotropic = self._sigmas["iso_sigma"] * generator.standard_normal(parents.shape)
        along = self._sigmas["line_sigma"] * generator.standard_normal((count, 1))
        return parents + isotropic + along * (others - parents)

    def _sparse_children(self, count: int) -> Genomes:
        generator = self._generator
        parents = self._archive.draw(generator, count)
        least, largest = (self._sigmas[f"sparse_sigma_{end}"] for end in ("min", "max"))
        for parent in parents:
            sigma = math.exp(generator.uniform(math.log(least), math.log(largest)))
            mutated = round(self.dimension ** generator.uniform())
            weights = generator.choice(self.dimension, mutated, replace=False)
            parent[weights] += sigma * generator.standard_normal(mutated)
        return parents

    def _tell(self, asked: Genomes, fitness: Fitness, added: AddResult | None) -> None:
        self._told += len(asked)

    def _state(self) -> State:
        return {"told": self._told}

    def _load_state(self, state: Mapping[str, Any]) -> None:
        self._told = state["told"]
