import shlex

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser

from ncrs.runs.wording import duration, override


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(3.6, "4 s"), (60, "1 min 0 s"), (3599.7, "1 h 0 min"), (7500, "2 h 5 min")],
)
def test_durations_are_said_in_their_two_largest_units(seconds, text):
    assert duration(seconds) == text


@pytest.mark.parametrize(
    "folder",
    ["runs/a", "my runs/a", "runs/sweep/optimizer.sigma=0.1,seed=0", "it's [here]", "ünï", "$HOME"],
)
def test_the_printed_resume_is_read_as_it_is(folder):
    (word,) = shlex.split(override("resume", folder))
    (parsed,) = OverridesParser.create().parse_overrides([word])
    assert (parsed.key_or_group, parsed.value()) == ("resume", folder)


def test_the_printed_resume_is_easy_to_read():
    assert override("resume", "my runs/a") == "\"resume='my runs/a'\""
