"""Views and learning aids for ordinary reinforcement-learning agents.

The wrappers here are for single environments; ``ncrs_envs.wrappers.vector`` has those of the same
names for vector environments, as in Gymnasium. None of them changes a registered task.
"""

from ncrs_envs.wrappers.single import (
    BodyConditionedView,
    DifferentialDrive,
    FixedBodyView,
    ProgressReward,
    SensorDifferences,
)

__all__ = [
    "BodyConditionedView",
    "DifferentialDrive",
    "FixedBodyView",
    "ProgressReward",
    "SensorDifferences",
]
