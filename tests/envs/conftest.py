"""Helpers for the tests of the environment suite."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from ncrs_envs.body import BodyGrid, Cell, parse_body
from ncrs_envs.tasks import Task


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20220312)


@pytest.fixture
def random_body(rng: np.random.Generator) -> Callable[..., BodyGrid]:
    """Draws valid bodies, sparse and dense, connected or not."""

    def draw(task: Task, grid_size: int = 5) -> BodyGrid:
        while True:
            occupied = rng.random((grid_size, grid_size)) < rng.uniform(0.2, 1.0)
            parts = rng.choice([int(c) for c in task.part_cells], (grid_size, grid_size))
            body = np.where(occupied, parts, int(Cell.EMPTY))
            if task.is_valid(body):
                return parse_body(body)

    return draw


@pytest.fixture
def uniform_gap() -> Callable[..., float]:
    """Distance of samples from the uniform law; above 1.95 about once in 1,000 times.

    The larger of two statistics: the Kolmogorov-Smirnov distance times sqrt(n), which is weak at
    the ends, and the gaps that n samples leave at the two ends, whose n-fold is exponentially
    distributed and exceeds 9.75 about once in 17,000 times.
    """

    def gap(samples: Any, low: float, high: float) -> float:
        ordered = (np.sort(np.asarray(samples, dtype=float)) - low) / (high - low)
        n = len(ordered)
        above = np.arange(1, n + 1) / n - ordered
        below = ordered - np.arange(n) / n
        distance = max(above.max(), below.max()) * np.sqrt(n)
        ends = max(ordered[0], 1.0 - ordered[-1]) * n
        return float(max(distance, ends / 5.0))

    return gap
