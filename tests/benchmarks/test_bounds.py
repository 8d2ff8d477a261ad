"""Limits of success: lengths of ways, and robots that know more than they sense."""

import math

import numpy as np
import pytest

from benchmarks.bounds import (
    DRIVERS,
    NIMBLE,
    REACH,
    TOUCH_SLIDER,
    TWO_SIDED,
    driven,
    one_eyed,
    steered,
    way,
)
from ncrs_envs.scenario import Scenario, sample_scenarios


def test_the_way_to_a_light_ends_at_the_success_radius():
    scenario = Scenario(start=(0.0, 0.0), light=(30.0, 40.0))
    assert way(scenario, 20.0) == pytest.approx(30.0)
    np.testing.assert_allclose(REACH, 100.0)


def test_the_way_through_the_passage_is_no_shorter_than_the_straight_one():
    scenarios = sample_scenarios("obstacle", 0, 50)
    ways = np.array([way(one, 20.0) for one in scenarios])
    straight = np.array([math.dist(one.start, one.light) - 20.0 for one in scenarios])
    assert (ways >= straight - 1e-9).all()
    assert (ways > straight + 1.0).any()


def test_a_ball_is_pushed_to_within_the_radius_of_the_target():
    scenario = Scenario(start=(0.0, -51.0), ball=(0.0, 0.0), target=(0.0, 36.0))
    to_ball = 51.0 - 5.0 * math.sqrt(2.0) - 1.0
    assert way(scenario, 10.0) == pytest.approx(to_ball + 26.0)


def test_positive_turns_are_anticlockwise():
    gas = steered(np.array([0.0, 0.5, -2.0]))
    assert gas.shape == (3, 5, 5)
    np.testing.assert_array_equal(gas[0], 1.0)
    np.testing.assert_allclose(gas[1, 0], [0.5, 0.5, 1.0, 1.0, 1.0])  # slower on the left
    np.testing.assert_allclose(gas[2, 4], [1.0, 1.0, 1.0, -1.0, -1.0])


def test_who_is_told_more_gets_further():
    courses = sample_scenarios("obstacle", 0, 80)
    blind, light, passage, both = (driven(driver, courses) for driver in DRIVERS)
    assert blind[0] < light[0] < both[0]
    assert passage[0] < both[0]
    assert blind[1] == light[1] < passage[1] == both[1]
    assert both[0] < 0.75  # of the ways are short enough, for a robot that need not turn


def test_a_touch_sensor_is_a_burden_and_more_sensors_are_a_greater_one():
    courses = sample_scenarios("obstacle", 0, 80)
    knowing = DRIVERS[-1]
    success, _ = driven(knowing, courses)
    touching, _ = driven(knowing, courses, TOUCH_SLIDER, "obstacle_touch")
    two_sided, _ = driven(knowing, courses, TWO_SIDED, "obstacle_touch")
    assert success > touching > two_sided > 0.0


def test_one_sensor_is_worth_less_than_being_told():
    courses = sample_scenarios("obstacle", 1, 400)
    blind, light, *_ = (driven(driver, courses, NIMBLE)[0] for driver in DRIVERS)
    assert blind < one_eyed(courses)[0] <= light
