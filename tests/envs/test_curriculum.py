"""Curricula: easier scenarios, which become the task's own."""

import numpy as np
import pytest

from ncrs_envs.curriculum import CURRICULA, along, check_curriculum, eased, nearer, reverse
from ncrs_envs.mirroring import ScenarioSampling, mirror_front_back, mirror_left_right
from ncrs_envs.scenario import ScenarioError, sample_scenarios
from ncrs_envs.tasks import TASKS, get_task

NAMES = [name for name in CURRICULA if name != "none"]
SUITABLE = [
    (task, name)
    for task in TASKS
    for name in NAMES
    if not (get_task(task).has_walls and name == "reverse")
    and not (not get_task(task).has_ball and name == "along")
]


def distance(one, other):
    return float(np.hypot(one[0] - other[0], one[1] - other[1]))


@pytest.mark.parametrize(("task", "name"), SUITABLE)
@pytest.mark.parametrize("ease", [0.0, 0.3, 1.0])
def test_scenarios_fit_the_task_and_mirror_images_stay_images(task, name, ease):
    ease_one = CURRICULA[name]
    drawn = sample_scenarios(task, 3, 40)
    easier = eased(drawn, name, ease, get_task(task), 5)
    assert (easier == drawn) == (ease == 0.0)
    for scenario, changed in zip(drawn[:8], easier, strict=False):
        for image in (mirror_left_right, mirror_front_back):
            found = ease_one(image(scenario), ease, get_task(task), 5)
            expected = image(changed)
            for field in ("start", "light", "ball", "target"):
                if getattr(expected, field) is not None:
                    np.testing.assert_allclose(
                        getattr(found, field), getattr(expected, field), atol=1e-12
                    )


def test_nearer_brings_the_light_nearer_and_widens_the_passage():
    (scenario,) = sample_scenarios("light_chase", 0, 1)
    changed = nearer(scenario, 0.5, get_task("light_chase"), 5)
    np.testing.assert_allclose(changed.light, np.array(scenario.light) * 0.8)
    (scenario,) = sample_scenarios("obstacle", 0, 1)
    changed = nearer(scenario, 0.5, get_task("obstacle"), 5)
    widths = [right[-1][0] - left[-1][0] for left, right in (scenario.walls, changed.walls)]
    np.testing.assert_allclose(widths, [7.0, 7.0 + 2 * 0.25 * 0.5 * 60])
    middle = (max(x for x, _ in scenario.walls[0]) + min(x for x, _ in scenario.walls[1])) / 2
    assert changed.light == pytest.approx(((scenario.light[0] + middle) / 2, scenario.light[1]))
    (scenario,) = sample_scenarios("carry_ball", 0, 1)
    changed = nearer(scenario, 1.0, get_task("carry_ball"), 5)
    ways = [
        distance(one.start, one.ball) + distance(one.ball, one.target)
        for one in (scenario, changed)
    ]
    assert ways[1] == pytest.approx(0.6 * ways[0])


def test_reverse_begins_behind_the_ball_near_the_target():
    task = get_task("carry_ball")
    for scenario in sample_scenarios(task, 1, 8):
        changed = reverse(scenario, 1.0, task, 5)
        assert changed.target == scenario.target
        left = distance(changed.ball, changed.target) / distance(scenario.ball, scenario.target)
        assert left == pytest.approx(0.25)
        assert changed.start == pytest.approx((changed.ball[0], changed.ball[1] - 8.0))
    with pytest.raises(ScenarioError, match=r"does not suit obstacle.*Use 'nearer'"):
        reverse(sample_scenarios("obstacle", 0, 1)[0], 1.0, get_task("obstacle"), 5)
    with pytest.raises(ScenarioError, match=r"curriculum must be one of \['none', 'nearer'"):
        check_curriculum("harder")


def test_along_begins_anywhere_on_the_way_to_the_ball():
    task = get_task("carry_ball")
    shares, later = [], []
    for scenario in sample_scenarios(task, 1, 400):
        behind = (scenario.ball[0], scenario.ball[1] - 8.0)
        way = distance(scenario.start, behind)
        for ease, found in ((1.0, shares), (0.3125, later)):
            changed = along(scenario, ease, task, 5)
            assert (changed.ball, changed.target) == (scenario.ball, scenario.target)
            found.append(distance(scenario.start, changed.start) / way)
            left = distance(changed.start, behind) / way
            assert found[-1] + left == pytest.approx(1.0)  # on the straight line
        assert along(scenario, 0.7, task, 5) == along(scenario, 1.0, task, 5)
    # A third begin behind the ball, the others evenly spread; at half of full ease half as far on.
    assert np.mean(np.array(shares) > 0.999) == pytest.approx(1 / 3, abs=0.05)
    np.testing.assert_allclose(np.quantile(shares, [0.2, 0.4]), [0.3, 0.6], atol=0.06)
    np.testing.assert_allclose(later, 0.5 * np.array(shares), atol=1e-12)
    with pytest.raises(ScenarioError, match=r"does not suit light_chase, which has no ball"):
        along(sample_scenarios("light_chase", 0, 1)[0], 1.0, get_task("light_chase"), 5)


def test_ease_falls_over_the_generations():
    sampling = ScenarioSampling(curriculum="nearer", curriculum_generations=4)
    assert [sampling.ease(generation) for generation in (0, 1, 4, 9, None)] == [1, 0.75, 0, 0, 0]
    assert ScenarioSampling().ease(0) == 0.0
    own = sample_scenarios("light_chase", 5, 4)
    for generation, share in ((0, 0.6), (2, 0.8), (4, 1.0), (None, 1.0)):
        drawn = sampling.draw("light_chase", 5, 4, generation=generation)
        for scenario, plain in zip(drawn, own, strict=True):
            np.testing.assert_allclose(scenario.light, np.array(plain.light) * share)
