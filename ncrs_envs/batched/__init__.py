"""The fast simulator: many robots at once, compiled with numba.

The same tasks, bodies, scenarios and constants as the Box2D environments; ``simulate`` documents
the kernels and ``layout`` the records that they take.
"""

from ncrs_envs.batched.records import (
    robot_records,
    scenario_records,
    settings_record,
    single_world,
)

__all__ = [
    "robot_records",
    "scenario_records",
    "settings_record",
    "single_world",
]
