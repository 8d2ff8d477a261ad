"""Engines: genomes and scenarios in, an ``Evaluation`` out. Source: paper sections 4 and 5.

- ``base``: the interface, its checks, and the registry of engines.
- ``box2d``, ``pool``: the reference, one process per core.
- ``batched``, ``rollout_kernels``, ``nca_kernels``, ``tiles``: the compiled engine, one thread per
  core; ``tapes`` records a rollout.
- ``cuda``: the same on GPUs.
- ``cluster``: shards of a population on workers of other machines, which use the engines above.
- ``evaluate``: evaluation in one call, for scripts and notebooks.
"""

from ncrs.engines.base import Engine, EngineError, Evaluation, EvaluationInterrupted, make_engine

__all__ = ["Engine", "EngineError", "Evaluation", "EvaluationInterrupted", "make_engine"]
