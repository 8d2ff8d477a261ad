"""What the tests of all engines of a cluster share."""

import numpy as np
import pytest

from ncrs.engines.base import make_engine
from ncrs_envs.scenario import sample_scenarios
from ncrs_envs.tasks import TaskSettings

SETTINGS = TaskSettings("light_chase")
SCENARIOS = sample_scenarios("light_chase", 0, 2)


@pytest.fixture
def check(population):
    """Compares an evaluation with the batched engine's, bit by bit."""
    with make_engine("batched", SETTINGS) as engine:
        expected = engine.evaluate(population, SCENARIOS)

    def compare(result):
        for name, value in vars(expected).items():
            np.testing.assert_array_equal(getattr(result, name), value, err_msg=name)

    return compare
