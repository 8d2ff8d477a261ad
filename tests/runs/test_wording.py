import pytest

from ncrs.runs.wording import duration


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(3.6, "4 s"), (60, "1 min 0 s"), (3599.7, "1 h 0 min"), (7500, "2 h 5 min")],
)
def test_durations_are_said_in_their_two_largest_units(seconds, text):
    assert duration(seconds) == text
