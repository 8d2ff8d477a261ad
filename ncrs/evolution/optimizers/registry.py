"""The optimizers by name."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from ncrs.evolution.optimizers.base import Optimizer
from ncrs.evolution.optimizers.settings import (
    CMAESSettings,
    CMAMAESettings,
    CMAMESettings,
    IsoCMAESSettings,
    MAPElitesSettings,
    OptimizerSettings,
    SepCMAESSettings,
)


class Entry(NamedTuple):
    """An optimizer's settings and class."""

    settings: type[OptimizerSettings]
    path: str
    """Module and class; the module is imported only when the optimizer is made."""


_HERE = "ncrs.evolution.optimizers"

OPTIMIZERS: Mapping[str, Entry] = MappingProxyType(
    {
        settings.name: Entry(settings, path)
        for settings, path in (
            (CMAESSettings, f"{_HERE}.cma_es:CMAES"),
            (SepCMAESSettings, f"{_HERE}.cma_es:CMAES"),
            (IsoCMAESSettings, f"{_HERE}.cma_es:CMAES"),
            (CMAMESettings, f"{_HERE}.cma_me:CMAME"),
            (CMAMAESettings, f"{_HERE}.cma_mae:CMAMAE"),
            (MAPElitesSettings, f"{_HERE}.map_elites:MAPElites"),
        )
    }
)


def make_optimizer(
    settings: OptimizerSettings, dimension: int, seed: np.random.SeedSequence
) -> Optimizer:
    """Make the optimizer whose settings are given.

    Args:
        settings: Record of one of ``OPTIMIZERS``.
        dimension: Length N of a genome.
        seed: Seed of the optimizer's generator, its only source of randomness.

    Raises:
        OptimizerError: If torch cannot use the device of the settings.
    """
    module, _, name = OPTIMIZERS[settings.name].path.partition(":")
    cls: type[Optimizer] = getattr(importlib.import_module(module), name)
    return cls(dimension, seed, settings)
