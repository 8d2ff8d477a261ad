"""Numbers as people read them."""

import pytest

from ncrs.runs.text import duration_text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.4, "0 s"),
        (59.4, "59 s"),
        (59.6, "1 min 0 s"),
        (307.0, "5 min 7 s"),
        (3600.0, "1 h 0 min"),
        (90061.0, "25 h 1 min"),
    ],
)
def test_durations(seconds, text):
    assert duration_text(seconds) == text
