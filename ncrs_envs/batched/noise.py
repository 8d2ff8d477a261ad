"""Normal noise by counter in kernels; see ``ncrs_envs.noise``."""

from __future__ import annotations

import math

import numpy as np

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.noise import FIRST_FACTOR, INCREMENT, SECOND_FACTOR, UNIT

# With a signed integer numba would compute in float64.
_INCREMENT = np.uint64(INCREMENT)
_FIRST_FACTOR = np.uint64(FIRST_FACTOR)
_SECOND_FACTOR = np.uint64(SECOND_FACTOR)
_ONE, _TWO = np.uint64(1), np.uint64(2)
_SHIFTS = np.array([30, 27, 31, 11], dtype=np.uint64)


@kernel
def normal_value(seed: int, stream: int, counter: int) -> float:
    """Return the standard normal value with that index in a seed's stream."""
    key = _mixed(_mixed(np.uint64(seed)) + np.uint64(stream)) + np.uint64(counter) * _TWO
    radius = math.sqrt(-2.0 * math.log(1.0 - _uniform(key)))
    return radius * math.cos(2.0 * math.pi * _uniform(key + _ONE))


@kernel
def _uniform(key: np.uint64) -> float:
    return float(_mixed(key) >> _SHIFTS[3]) * UNIT


@kernel
def _mixed(key: np.uint64) -> np.uint64:
    mixed = key + _INCREMENT
    mixed = (mixed ^ (mixed >> _SHIFTS[0])) * _FIRST_FACTOR
    mixed = (mixed ^ (mixed >> _SHIFTS[1])) * _SECOND_FACTOR
    return np.uint64(mixed ^ (mixed >> _SHIFTS[2]))
