"""Statistics for reporting results."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

NORMAL_95 = 1.959963984540054
"""Two-sided 95 % quantile of the normal distribution."""
_RESAMPLES = 10_000


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """Compute the 95 % score interval of a proportion. Source: Wilson 1927.

    Raises:
        ValueError: If there are no trials, or ``successes`` is not from 0 to ``trials``.
    """
    if trials < 1 or not 0 <= successes <= trials:
        raise ValueError(f"need 0 <= successes <= trials and trials > 0, got {successes}/{trials}.")
    fraction = successes / trials
    squared = NORMAL_95**2
    center = (fraction + squared / (2 * trials)) / (1 + squared / trials)
    half = (NORMAL_95 / (1 + squared / trials)) * math.sqrt(
        fraction * (1 - fraction) / trials + squared / (4 * trials**2)
    )
    # The interval includes fractions of exactly 0 and 1; rounding must not exclude them.
    low = 0.0 if successes == 0 else max(0.0, center - half)
    high = 1.0 if successes == trials else min(1.0, center + half)
    return low, high


def interquartile_mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the mean of the middle half along the last axis.

    A quarter of the values, rounded down, is left out at each end. Source: Agarwal et al. 2021.
    """
    ordered = np.sort(values, axis=-1)
    cut = ordered.shape[-1] // 4
    kept = ordered[..., cut : ordered.shape[-1] - cut]
    return np.asarray(kept.mean(axis=-1))


def bootstrap_interval(
    values: Sequence[float],
    statistic: Callable[[NDArray[np.float64]], NDArray[np.float64]] = interquartile_mean,
) -> tuple[float, float]:
    """Compute the 95 % percentile interval of a statistic of independent runs.

    Args:
        values: One value for each run, at least one.
        statistic: Function of values along the last axis.

    Source: Efron 1979; 10,000 resamples, always the same ones.
    """
    runs = np.asarray(values, dtype=np.float64)
    chosen = np.random.default_rng(0).integers(len(runs), size=(_RESAMPLES, len(runs)))
    low, high = np.percentile(statistic(runs[chosen]), [2.5, 97.5])
    return float(low), float(high)
