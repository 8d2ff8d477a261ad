"""The optimizers by name."""

from __future__ import annotations

import importlib
from dataclasses import MISSING, fields
from typing import NamedTuple

import numpy as np

from ncrs.evolution.optimizers.base import Optimizer
from ncrs.evolution.optimizers.settings import (
    CMAESSettings,
    CMAMAESettings,
    CMAMESettings,
    DraftsSettings,
    IsoCMAESSettings,
    MAPElitesSettings,
    OptimizerSettings,
    SepCMAESSettings,
)
from ncrs_envs.registry import ExtensionError, Registry


class Entry(NamedTuple):
    """An optimizer's settings and class."""

    settings: type[OptimizerSettings]
    optimizer: str | type[Optimizer]
    """The class, or its module and name: then it is imported only when the optimizer is made."""


_HERE = "ncrs.evolution.optimizers"

OPTIMIZERS: Registry[Entry] = Registry(
    "optimizer",
    {
        settings.name: Entry(settings, path)
        for settings, path in (
            (CMAESSettings, f"{_HERE}.cma_es:CMAES"),
            (SepCMAESSettings, f"{_HERE}.cma_es:CMAES"),
            (IsoCMAESSettings, f"{_HERE}.cma_es:CMAES"),
            (CMAMESettings, f"{_HERE}.cma_me:CMAME"),
            (CMAMAESettings, f"{_HERE}.cma_mae:CMAMAE"),
            (MAPElitesSettings, f"{_HERE}.map_elites:MAPElites"),
            (DraftsSettings, "ncrs.drafts.optimizer:Drafts"),
        )
    },
)


def register_optimizer(settings: type[OptimizerSettings], optimizer: type[Optimizer]) -> None:
    """Make an optimizer known by its name, the default of ``settings.name``.

    Args:
        settings: Dataclass of the optimizer's settings, all with defaults.
        optimizer: Class with ``_ask``, ``_tell``, ``_state`` and ``_load_state``, ``mean`` and
            ``metrics``.

    Raises:
        ExtensionError: If another optimizer has that name, or a setting has no default.
    """
    missing = [item.name for item in fields(settings) if item.default is MISSING]
    if missing:
        raise ExtensionError(
            f"All settings of an optimizer need defaults; {settings.__name__} has none for "
            f"{', '.join(missing)}."
        )
    defaults = {item.name: item.default for item in fields(settings)}
    OPTIMIZERS.register(str(defaults["name"]), Entry(settings, optimizer))


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
    optimizer = OPTIMIZERS[settings.name].optimizer
    if isinstance(optimizer, str):
        module, _, name = optimizer.partition(":")
        optimizer = getattr(importlib.import_module(module), name)
    made: Optimizer = optimizer(dimension, seed, settings)
    return made
