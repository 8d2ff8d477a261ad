"""The fast simulator: many robots at once, compiled with numba.

The same tasks, bodies, scenarios and constants as the Box2D environments; ``simulate`` documents
the kernels and their arrays.
"""

from ncrs_envs.batched.layout import STATE_SIZE
from ncrs_envs.batched.records import robot_arrays, scenario_arrays, settings_array

__all__ = [
    "STATE_SIZE",
    "robot_arrays",
    "scenario_arrays",
    "settings_array",
]
