"""Optimizers behind one small interface: ask, tell, state."""

from ncrs.evolution.optimizers.base import Optimizer, OptimizerError, make_optimizer

__all__ = ["Optimizer", "OptimizerError", "make_optimizer"]
