from dataclasses import replace

import numpy as np
import pytest

from ncrs_envs import (
    Damage,
    Noise,
    PerturbationError,
    Repair,
    Scenario,
    ScenarioError,
    WheelFailure,
)
from ncrs_envs.body import parse_body
from ncrs_envs.perturbations import mirrored
from ncrs_envs.tasks import LIGHT_CHASE

BODY = parse_body(["L#L", "W#W", "..."])


def test_listed_cells_vanish_where_there_are_any():
    left = Damage(0, [(0, 0), (2, 2), (1, 2)]).left(BODY)
    np.testing.assert_array_equal(left, parse_body([".#L", "W#.", "..."]))
    assert left.dtype == np.int8
    assert not left.flags.writeable


@pytest.mark.parametrize(("fraction", "lost"), [(0.0, 0), (0.1, 1), (0.34, 3), (0.5, 3), (1.0, 5)])
def test_a_fraction_takes_the_first_modules_rounded_up_and_one_stays(fraction, lost):
    order = [(2, 0), (1, 1), (0, 2), (0, 1), (1, 0), (1, 2), (0, 0)]
    left = Damage(3, order, fraction).left(BODY)
    taken = [place for place in order if BODY[place] != 0][:lost]
    expected = BODY.copy()
    for place in taken:
        expected[place] = 0
    np.testing.assert_array_equal(left, expected)


def test_only_wheels_fail():
    failed = WheelFailure(0, [(0, 0), (1, 2), (1, 0)], 0.5).failed(BODY)
    assert np.argwhere(failed).tolist() == [[1, 2]]
    assert WheelFailure(0, [(0, 0), (1, 2), (1, 0)]).failed(BODY).sum() == 2


def test_mirrored_cells():
    damage = Damage(2, [(0, 0), (1, 2)], 0.5)
    assert mirrored(damage, 3) == Damage(2, [(0, 2), (1, 0)], 0.5)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Damage(-1, []), "step must be a non-negative integer"),
        (lambda: Damage(0, [(0,)]), "pairs"),
        (lambda: Damage(0, [(0, 1), (0, 1)]), "twice"),
        (lambda: Damage(0, [(0, 1.5)]), "column must be"),
        (lambda: Damage(0, [], float("nan")), "fraction must lie in 0 to 1"),
        (lambda: Damage(0, [(0, 3)]).check(3), "3 x 3"),
        (lambda: Noise(0, float("inf")), "sensor noise must be finite"),
        (lambda: Noise(-1), "seed"),
        (lambda: Repair(0), "at least 1 step"),
        (lambda: Repair(2, True), "repair_every"),
    ],
)
def test_malformed_records_are_refused(make, message):
    with pytest.raises(PerturbationError, match=message):
        make()


def test_a_scenario_checks_its_perturbations():
    scenario = Scenario((0.0, 0.0), light=(30.0, 30.0))
    assert not scenario.is_perturbed
    assert replace(scenario, repair=Repair(4)).is_perturbed
    with pytest.raises(ScenarioError, match="damage must be a Damage"):
        replace(scenario, damage=[(0, 0)])
    with pytest.raises(PerturbationError, match="5 x 5"):
        replace(scenario, failure=WheelFailure(0, [(5, 0)])).check(LIGHT_CHASE, 5)
