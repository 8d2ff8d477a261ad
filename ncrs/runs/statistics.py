"""Statistics for reporting results."""

from __future__ import annotations

import math

_Z_95 = 1.959963984540054
"""Two-sided 95 % quantile of the normal distribution."""


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """Compute the 95 % score interval of a proportion. Source: Wilson 1927.

    Raises:
        ValueError: If there are no trials, or ``successes`` is not from 0 to ``trials``.
    """
    if trials < 1 or not 0 <= successes <= trials:
        raise ValueError(f"need 0 <= successes <= trials and trials > 0, got {successes}/{trials}.")
    fraction = successes / trials
    squared = _Z_95**2
    center = (fraction + squared / (2 * trials)) / (1 + squared / trials)
    half = (_Z_95 / (1 + squared / trials)) * math.sqrt(
        fraction * (1 - fraction) / trials + squared / (4 * trials**2)
    )
    # The interval includes fractions of exactly 0 and 1; rounding must not exclude them.
    low = 0.0 if successes == 0 else max(0.0, center - half)
    high = 1.0 if successes == trials else min(1.0, center + half)
    return low, high
