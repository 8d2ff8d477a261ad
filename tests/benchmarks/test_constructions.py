"""Full throttle in Obstacle, beside what is known of the published dynamics."""

import pytest

from benchmarks.constructions import BODIES, full_throttle
from ncrs.runs.statistics import wilson_interval

# Fitness and half its 95 % interval, success and crossed in 1,000 episodes; measured in the
# published dynamics, and as one rigid body.
KNOWN = {
    ("arrow", "jointed"): (0.388, 0.005, 213, 860),
    ("fork", "jointed"): (0.358, 0.005, 118, 504),
    ("arrow", "rigid"): (0.374, 0.005, 149, 686),
    ("fork", "rigid"): (0.345, 0.005, 49, 392),
}


def _compare(name, construction, episodes):
    """Assert that the intervals of all three numbers overlap with those that are known."""
    fitness, half_width, success, crossed = KNOWN[name, construction]
    drive = full_throttle(BODIES[name], construction, episodes)
    assert drive.fitness == pytest.approx(fitness, abs=half_width + drive.half_width)
    for share, count in ((drive.success, success), (drive.crossed, crossed)):
        known_low, known_high = wilson_interval(count, 1000)
        assert share.interval[0] < known_high
        assert share.interval[1] > known_low


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize(("name", "construction"), KNOWN)
def test_full_throttle_is_as_known(name, construction):
    _compare(name, construction, 1000)


def test_a_sample_of_it_is_as_known():
    _compare("arrow", "jointed", 40)
