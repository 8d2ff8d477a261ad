"""Mirror images of scenarios: geometry, order, and noise."""

import numpy as np
import pytest

from ncrs_envs.mirroring import (
    PLAIN_SAMPLING,
    ScenarioSampling,
    mirror_front_back,
    mirror_left_right,
)
from ncrs_envs.scenario import CORNER_REGIONS, ScenarioError, sample_scenarios, wall_quads
from ncrs_envs.tasks import TASKS, get_task


@pytest.mark.parametrize("task", TASKS)
def test_none_draws_as_ever(task):
    assert PLAIN_SAMPLING.draw(task, 3, 5) == sample_scenarios(task, 3, 5)


@pytest.mark.parametrize("task", TASKS)
def test_mirroring_twice_gives_the_scenario_back(task):
    for scenario in sample_scenarios(task, 0, 4):
        image = mirror_left_right(scenario)
        assert image != scenario
        assert mirror_left_right(image) == scenario
        image.check(get_task(task), 5)


def test_the_light_stands_in_all_four_corners():
    lights = np.array([s.light for s in ScenarioSampling("all").draw("light_chase", 1, 8)])
    corners = np.array(CORNER_REGIONS)[[2, 0, 1, 3]]
    np.testing.assert_array_equal(np.sign(lights), np.tile(corners, (2, 1)))
    # Opposite corners follow each other, so that any even number of runs is balanced.
    np.testing.assert_allclose(lights[::2] + lights[1::2], 0.0, atol=1e-12)
    for four in (lights[:4], lights[4:]):
        np.testing.assert_allclose(four.sum(axis=0), 0.0, atol=1e-12)
    assert abs(lights[0, 0]) != abs(lights[4, 0])


def test_front_and_back_alternate_and_sides_take_turns():
    drawn = ScenarioSampling("front_back").draw("light_chase", 1, 6)
    lights = np.array([s.light for s in drawn])
    np.testing.assert_array_equal(np.sign(lights[:, 1]), [1, -1, 1, -1, 1, -1])
    np.testing.assert_array_equal(np.sign(lights[:, 0]), [1, 1, -1, -1, 1, 1])
    assert drawn[1] == mirror_front_back(drawn[0])


@pytest.mark.parametrize("task", ["obstacle", "carry_ball"])
def test_columns_come_with_their_left_right_images(task):
    drawn = ScenarioSampling("all").draw(task, 5, 4)
    assert drawn[1] == mirror_left_right(drawn[0])
    assert drawn[3] == mirror_left_right(drawn[2])
    seen = [s.light or s.ball for s in drawn]
    assert all(point is not None for point in seen)
    columns = np.array(seen)[:, 0] / 60.0
    np.testing.assert_allclose(columns, [-0.6, 0.6, -0.3, 0.3], atol=0.05)


@pytest.mark.parametrize("mirroring", ["front_back", "all"])
def test_a_longer_evaluation_begins_with_the_shorter(mirroring):
    short = ScenarioSampling(mirroring).draw("light_chase", 7, 5)
    assert len(short) == 5
    assert ScenarioSampling(mirroring).draw("light_chase", 7, 12)[:5] == short
    seed = np.random.SeedSequence(7)
    assert ScenarioSampling(mirroring).draw("light_chase", seed, 5) == short


def test_an_unknown_mirroring_is_refused():
    with pytest.raises(ScenarioError, match=r"one of.*'left'"):
        ScenarioSampling("left").draw("light_chase", 0, 4)


@pytest.mark.parametrize("task", sorted(TASKS))
def test_front_and_back_are_exchanged_as_by_a_robot_that_turned(task):
    """A world mirrored front to back and left to right is the same world turned by half a turn."""
    drawn = ScenarioSampling("front_back").draw(task, 4, 6)
    for scenario, image in zip(drawn[::2], drawn[1::2], strict=True):
        assert mirror_front_back(image) == scenario
        image.check(get_task(task), 5)
        turned = -wall_quads(mirror_left_right(image), 5)
        # The same quads, from the other end, each with its vertices in another order.
        expected = wall_quads(scenario, 5)
        assert turned.shape == expected.shape
        centers = [np.sort(quads.mean(axis=1).round(9), axis=0) for quads in (turned, expected)]
        np.testing.assert_allclose(*centers)


@pytest.mark.parametrize("task", sorted(TASKS))
@pytest.mark.parametrize("mirroring", ["none", "all"])
def test_noise_spreads_what_the_robot_looks_for(task, mirroring):
    """Over 200 draws it fills most of its range, which lies in the playfield."""
    drawn = ScenarioSampling(mirroring, 0.25).draw(task, 2, 200)
    heights = np.array([(s.light or s.ball)[1] for s in drawn]) / 60.0
    if task == "light_chase":
        heights = np.abs(heights)
    assert 0.4 < np.ptp(heights) <= 0.5
    for scenario in drawn:
        scenario.check(get_task(task), 5)


@pytest.mark.parametrize("noise", [-0.1, 0.36, float("nan"), True, "0.1"])
def test_noise_out_of_range_is_refused(noise):
    with pytest.raises(ScenarioError, match=r"0 to 0\.35"):
        ScenarioSampling("none", noise).draw("light_chase", 0, 4)
