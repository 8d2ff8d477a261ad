"""The batched simulator against Box2D over as many cases as the documentation quotes."""

import pytest

from benchmarks.parity import compare_contact, compare_free
from ncrs_envs.tasks import TASKS


@pytest.mark.slow
def test_free_motion():
    result = compare_free(240)
    assert result["met"], result


@pytest.mark.slow
@pytest.mark.parametrize("task", sorted(TASKS))
def test_contact(task):
    result = compare_contact(TASKS[task], 320)
    assert result["met"], result
