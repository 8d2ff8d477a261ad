"""Random worlds of every size on both simulators; `NCRS_FUZZ=fuzz pytest -m slow` runs more."""

import math

import numpy as np
import pytest

from benchmarks.parity import contact_cases, free_cases, run_batched, run_box2d
from ncrs_envs.scenario import ScenarioError
from ncrs_envs.tasks import TASKS, get_task

SIZES = range(3, 16)
FREE_UNITS = 0.0003
"""Centres after 100 steps without contact; bodies of 15 x 15 drive three times as far as 5 x 5."""
FITNESS = 0.03
MEAN_FITNESS = 0.001
WORST = [
    ("light_chase", 20658), ("light_chase", 20471), ("obstacle", 21271), ("obstacle", 21331),
    ("carry_ball", 21158), ("carry_ball", 20659), ("carry_ball", 20952),
]  # fmt: skip
"""The worst of 1,500 episodes of each task."""


def differences(task, count, first):
    """Differences in fitness between the simulators, of episodes that may start."""
    found = []
    for case in contact_cases(task, count, SIZES, first):
        try:
            case.scenario.check(task, len(case.body))
        except ScenarioError:
            continue
        found.append(run_batched(task, case).fitness - run_box2d(task, case).fitness)
    return np.abs(found)


def check(count, first):
    light_chase = get_task("light_chase")
    for case in free_cases(count, SIZES, first):
        ends = run_box2d(light_chase, case).center, run_batched(light_chase, case).center
        assert math.dist(*ends) <= FREE_UNITS, case.seed
    for name in sorted(TASKS):
        found = differences(get_task(name), count, first)
        assert len(found) > count / 2
        assert found.max() <= FITNESS, (name, first + int(found.argmax()))
        assert found.mean() <= MEAN_FITNESS, name


def test_random_worlds_of_all_sizes():
    check(25, 0)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(20))
def test_many_random_worlds_of_all_sizes(part):
    check(1000, 100_000 + 1000 * part)


@pytest.mark.parametrize(("task", "seed"), WORST)
def test_the_worst_known_worlds(task, seed):
    assert differences(get_task(task), 1, seed).max() <= FITNESS
