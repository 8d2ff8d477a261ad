"""Intervals."""

import numpy as np
import pytest

from ncrs.runs.statistics import wilson_interval


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [
        # At the ends one bound is z^2 / (n + z^2) away.
        (0, 100, 0.0, 0.036993),
        (100, 100, 0.963007, 1.0),
        (1, 2, 0.094531, 0.905469),
    ],
)
def test_known_values(successes, trials, low, high):
    assert wilson_interval(successes, trials) == pytest.approx((low, high), abs=2e-5)


def test_it_solves_the_score_equation():
    share, trials = 0.37, 100
    for bound in wilson_interval(37, trials):
        z = (share - bound) / np.sqrt(bound * (1 - bound) / trials)
        assert abs(z) == pytest.approx(1.959964, abs=1e-5)


@pytest.mark.parametrize(("successes", "trials"), [(0, 0), (-1, 5), (6, 5)])
def test_bad_counts(successes, trials):
    with pytest.raises(ValueError, match="successes"):
        wilson_interval(successes, trials)
