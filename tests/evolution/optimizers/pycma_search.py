"""The search that pycma makes with our settings, whatever the covariance."""

import numpy as np

from ncrs.evolution.optimizers import OPTIMIZERS
from ncrs.evolution.optimizers.cma_es import CMAES


class PycmaSearch(CMAES):
    """CMA-ES by ``cma.CMAEvolutionStrategy`` alone."""

    def _make(self, start, sampler):
        return self._make_pycma(start, sampler)


def make_pair(name, dimension, seed=3, **settings):
    """Make our search and pycma's with the same settings and seed."""
    record = OPTIMIZERS[name].settings(**settings)
    return [kind(dimension, np.random.SeedSequence(seed), record) for kind in (CMAES, PycmaSearch)]
