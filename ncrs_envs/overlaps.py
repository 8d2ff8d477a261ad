"""Overlap of the robot's square grid with walls."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray


def wall_reach(line: Sequence[tuple[float, float]], sign: float, low: float, high: float) -> float:
    """Return how far a wall reaches inwards between two heights, as ``sign * x``."""
    reach = -math.inf
    for (x0, y0), (x1, y1) in pairwise(line):
        bottom, top = max(low, min(y0, y1)), min(high, max(y0, y1))
        if bottom >= top:
            continue
        slope = (x1 - x0) / (y1 - y0)
        for y in (bottom, top):
            reach = max(reach, sign * (x0 + slope * (y - y0)))
    return reach


def square_overlaps(center: tuple[float, float], half: float, quads: NDArray[np.float64]) -> bool:
    """Return True if an axis-aligned square overlaps any quad, by the separating-axis theorem.

    The square is the robot's whole grid, whatever its body, since bodies share scenarios.
    """
    x, y = center
    low, high = quads.min(axis=1), quads.max(axis=1)
    near = (
        (low[:, 0] < x + half)
        & (high[:, 0] > x - half)
        & (low[:, 1] < y + half)
        & (high[:, 1] > y - half)
    )
    if not near.any():
        return False
    quads = quads[near]
    # The boxes cover the quads' horizontal and vertical sides; the remaining axis is the normal of
    # the slanted edge between vertices 1 and 2.
    edge = quads[:, 2] - quads[:, 1]
    normal = np.stack([-edge[:, 1], edge[:, 0]], axis=-1)
    projected = (quads * normal[:, None, :]).sum(axis=-1)
    middle = x * normal[:, 0] + y * normal[:, 1]
    reach = half * np.abs(normal).sum(axis=-1)
    slanted = (projected.min(axis=1) < middle + reach) & (projected.max(axis=1) > middle - reach)
    return bool(slanted.any())
