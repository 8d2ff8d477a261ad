"""Random worlds of every size on both simulators; `NCRS_FUZZ=fuzz pytest -m slow` runs more."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.parity import contact_cases, free_cases, run_batched, run_box2d
from ncrs_envs.scenario import ScenarioError
from ncrs_envs.tasks import TASKS, get_task

SIZES = range(3, 16)
FREE_UNITS = 0.0003
"""Centres after 100 steps without contact; bodies of 15 x 15 drive three times as far as 5 x 5."""
FITNESS = 0.03
"""Largest difference in fitness of an episode that is not sensitive, see ``is_sensitive``."""
SHIFTS = [
    (distance * math.cos(angle), distance * math.sin(angle))
    for distance in (1e-5, 1e-4, 1e-3)
    for angle in np.arange(8) * math.pi / 4
]
"""Moves of the start, in units."""
MEAN_FITNESS = 0.001
WORST = [
    ("light_chase", 20658), ("light_chase", 301496), ("light_chase", 301995),
    ("light_chase", 111778), ("carry_ball", 116596),
    ("obstacle", 21271), ("obstacle", 21331), ("obstacle", 300103),
    ("carry_ball", 21158), ("carry_ball", 20659), ("carry_ball", 20952),
]  # fmt: skip
"""The worst of 23,500 episodes of each task."""


def is_sensitive(task, case, difference):
    """True if a simulator differs from itself half as much when the start moves by 0.001 units."""
    x, y = case.scenario.start
    moved = [
        replace(case, scenario=replace(case.scenario, start=(x + right, y + ahead)))
        for right, ahead in SHIFTS
    ]
    for run in (run_box2d, run_batched):
        fitness = run(task, case).fitness
        if any(abs(run(task, other).fitness - fitness) >= difference / 2 for other in moved):
            return True
    return False


def check_contacts(name, count, first):
    """Compare episodes that may start; return their number and their mean difference."""
    task, found = get_task(name), []
    for case in contact_cases(task, count, SIZES, first):
        try:
            case.scenario.check(task, len(case.body))
        except ScenarioError:
            continue
        difference = abs(run_batched(task, case).fitness - run_box2d(task, case).fitness)
        assert difference <= FITNESS or is_sensitive(task, case, difference), (name, case.seed)
        found.append(difference)
    return len(found), np.mean(found)


def check(count, first):
    light_chase = get_task("light_chase")
    for case in free_cases(count, SIZES, first):
        ends = run_box2d(light_chase, case).center, run_batched(light_chase, case).center
        assert math.dist(*ends) <= FREE_UNITS, case.seed
    for name in sorted(TASKS):
        compared, mean = check_contacts(name, count, first)
        assert compared > count / 2
        assert mean <= MEAN_FITNESS, name


def test_random_worlds_of_all_sizes():
    check(25, 0)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(20))
def test_many_random_worlds_of_all_sizes(part):
    check(1000, 100_000 + 1000 * part)


@pytest.mark.parametrize(("task", "seed"), WORST)
def test_the_worst_known_worlds(task, seed):
    assert check_contacts(task, 1, seed)[0] == 1
