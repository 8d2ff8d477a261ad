"""Statistics that results are reported with."""

from __future__ import annotations

import math

_Z_95 = 1.959963984540054
"""Two-sided 95 % quantile of the normal distribution."""


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """95 % score interval of a proportion. Source: Wilson 1927.

    Raises:
        ValueError: no trials, or a number of successes that is not between 0 and the trials.
    """
    if trials < 1 or not 0 <= successes <= trials:
        raise ValueError(f"need 0 <= successes <= trials and trials > 0, got {successes}/{trials}.")
    fraction = successes / trials
    squared = _Z_95**2
    center = (fraction + squared / (2 * trials)) / (1 + squared / trials)
    half = (_Z_95 / (1 + squared / trials)) * math.sqrt(
        fraction * (1 - fraction) / trials + squared / (4 * trials**2)
    )
    # At either end the interval reaches it exactly; rounding must not leave it outside.
    low = 0.0 if successes == 0 else max(0.0, center - half)
    high = 1.0 if successes == trials else min(1.0, center + half)
    return low, high
