"""Optimizers behind one small interface (ask, tell, state), each with its record of settings."""

from ncrs.evolution.optimizers.base import Optimizer
from ncrs.evolution.optimizers.registry import OPTIMIZERS, make_optimizer, register_optimizer
from ncrs.evolution.optimizers.settings import (
    CMAESSettings,
    CMAMAESettings,
    CMAMESettings,
    IsoCMAESSettings,
    MAPElitesSettings,
    OptimizerError,
    OptimizerSettings,
    SepCMAESSettings,
)

__all__ = [
    "OPTIMIZERS",
    "CMAESSettings",
    "CMAMAESettings",
    "CMAMESettings",
    "IsoCMAESSettings",
    "MAPElitesSettings",
    "Optimizer",
    "OptimizerError",
    "OptimizerSettings",
    "SepCMAESSettings",
    "make_optimizer",
    "register_optimizer",
]
