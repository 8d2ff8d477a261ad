"""Normal noise by counter: any simulator can compute any value of it, in any order."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SENSOR_NOISE, STATE_NOISE = 0, 1
"""Streams of one seed."""
INCREMENT, FIRST_FACTOR, SECOND_FACTOR = 0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB
"""Constants of the generator SplitMix64."""
UNIT = 2.0**-53
"""Distance of the numbers in [0, 1) that 53 bits make."""


def normal_noise(seed: int, stream: int, counters: NDArray[np.int64]) -> NDArray[np.float64]:
    """Compute standard normal values.

    Args:
        seed: Non-negative seed.
        stream: Stream, ``SENSOR_NOISE`` or ``STATE_NOISE``.
        counters: Non-negative index of each value in its stream, any shape.

    Returns:
        float64, same shape.
    """
    key = _mixed(_mixed(np.array([seed], dtype=np.uint64)) + np.uint64(stream))
    doubled = key + np.asarray(counters).astype(np.uint64) * np.uint64(2)
    first, second = _uniform(doubled), _uniform(doubled + np.uint64(1))
    return np.asarray(np.sqrt(-2.0 * np.log(1.0 - first)) * np.cos(2.0 * np.pi * second))


def _uniform(keys: NDArray[np.uint64]) -> NDArray[np.float64]:
    return (_mixed(keys) >> np.uint64(11)).astype(np.float64) * UNIT


def _mixed(keys: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Scramble 64 bits, as SplitMix64 does."""
    mixed = keys + np.uint64(INCREMENT)
    mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(FIRST_FACTOR)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(SECOND_FACTOR)
    return np.asarray(mixed ^ (mixed >> np.uint64(31)))
