"""MAP-Elites: variation of random elites, without a model of the search space.

Source: Mouret and Clune 2015; for the iso+line operator Vassiliades and Mouret 2018.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ncrs.automaton.device_genomes import AnyGenomes
from ncrs.evolution.archive import AddResult
from ncrs.evolution.optimizers.base import Fitness, Genomes, State
from ncrs.evolution.optimizers.quality_diversity import QDOptimizer
from ncrs.evolution.optimizers.settings import MAPElitesSettings
from ncrs.evolution.schema import check_like


class MAPElites(QDOptimizer):
    """MAP-Elites with iso+line variation and sparse mutations of mixed size.

    The first ``initial_genomes`` genomes are normal around 0 (zeros themselves grow no valid
    body); more follow while the archive is empty. After that every genome is the child of a
    random elite, by one of two operators:

    - iso+line: ``x_i + iso_sigma N(0, I) + line_sigma N(0, 1) (x_j - x_i)`` for two elites
      (Vassiliades and Mouret, equation 1);
    - sparse: a random fraction of the weights gets normal noise. The fraction is log-uniform from
      one weight to all, the noise's size log-uniform from ``sparse_sigma_min`` to
      ``sparse_sigma_max``, both drawn for each child. No single step size suits both growth, which
      one weight can change, and control.
    """

    settings: MAPElitesSettings

    def __init__(
        self, dimension: int, seed: np.random.SeedSequence, settings: MAPElitesSettings
    ) -> None:
        super().__init__(dimension, seed, settings)
        self._told = 0

    def metrics(self) -> dict[str, float]:
        """Return 1 while the first genomes are drawn, then 0."""
        return {"initial": float(self._told < self.settings.initial_genomes)}

    def _ask(self) -> Genomes:
        settings = self.settings
        size = (settings.population, self.dimension)
        if self._told < settings.initial_genomes or not len(self._archive):
            return settings.initial_sigma * self._generator.standard_normal(size)
        sparse = int(self._generator.binomial(settings.population, settings.sparse_fraction))
        return np.concatenate(
            [self._sparse_children(sparse), self._line_children(settings.population - sparse)]
        )

    def _line_children(self, count: int) -> Genomes:
        generator = self._generator
        parents = self._archive.draw(generator, count)
        others = self._archive.draw(generator, count)
        isotropic = self.settings.iso_sigma * generator.standard_normal(parents.shape)
        along = self.settings.line_sigma * generator.standard_normal((count, 1))
        return parents + isotropic + along * (others - parents)

    def _sparse_children(self, count: int) -> Genomes:
        generator = self._generator
        parents = self._archive.draw(generator, count)
        ends = self.settings.sparse_sigma_min, self.settings.sparse_sigma_max
        low, high = (math.log(sigma) for sigma in ends)
        for parent in parents:
            sigma = math.exp(generator.uniform(low, high))
            mutated = round(self.dimension ** generator.uniform())
            weights = generator.choice(self.dimension, mutated, replace=False)
            parent[weights] += sigma * generator.standard_normal(mutated)
        return parents

    def _tell(self, asked: AnyGenomes, fitness: Fitness, added: AddResult | None) -> None:
        self._told += len(asked)

    def _state(self) -> State:
        return {"told": self._told}

    def _load_state(self, state: Mapping[str, Any]) -> None:
        check_like(state["told"], 0, "told")
        self._told = state["told"]
