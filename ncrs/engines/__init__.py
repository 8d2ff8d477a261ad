"""Engines: what turns genomes and scenarios into an ``Evaluation``.

``box2d`` is the reference, one process per core; ``batched`` is the fast one.
"""

from ncrs.engines.base import Engine, EngineError, Evaluation, EvaluationInterrupted, make_engine

__all__ = ["Engine", "EngineError", "Evaluation", "EvaluationInterrupted", "make_engine"]
