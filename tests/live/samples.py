"""Functions for the tests of the translator, in the subset of Python that kernels use."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.layout import Point

LIMIT = 3
RATIO = np.float32(0.1)


class Pair(NamedTuple):
    first: float
    second: float


def whole_numbers(a: int, b: int) -> float:
    return a // b + 0.5 * (a % b)


def extremes(a: float, b: float) -> tuple[float, float]:
    return min(a, b), max(a, b)


def rounded(values: NDArray[np.float32]) -> float:
    total = values[0]
    for i in range(1, len(values)):
        total += values[i] * RATIO
    return float(total)


def chained(a: int) -> bool:
    return 0 <= a < LIMIT and a in (0, 2)


def named(pair: Pair) -> float:
    first, second = Pair(pair.second, pair.first)
    return math.copysign(first, second) ** 2 - abs(first)


def filled(n: int) -> float:
    grid = np.zeros((n, n), dtype=np.float32)
    grid[1] = 2.0
    grid[0, n - 1] = 5.0
    row = grid[0]
    row[0] += 1.0
    copy = np.empty_like(grid)
    copy[:] = grid
    total = 0.0
    for i in range(0, n, 2):
        for j in range(n):
            total += copy[i, j] * (i + 1)
    return total + np.argmax(copy[0]) + copy.shape[1]


def loops(n: int) -> int:
    found = 0
    while True:
        n -= 1
        if n < 0:
            break
        elif n % 3 == 0:
            continue
        found += n
    return found


def reused(n: int) -> float:
    total = 0
    for i in range(n):
        total += i
    if total > 100:
        return 0
    i = 0.5
    for k in range(2):
        i += k
    k = 3
    return total + i * k


def moved(point: Point, points: NDArray[Point]) -> float:
    for i in range(len(points[1:])):
        other: Point = points[1:][i]
        point.x += other.x if other.x > 0.0 else -other.x
        other.y = point.x
    return point.x
