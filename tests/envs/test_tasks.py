"""Task rules: which bodies are valid, partial credit, scores, settings."""

import math

import numpy as np
import pytest

from ncrs_envs.body import BodyError, Cell, parse_body
from ncrs_envs.tasks import (
    CARRY_BALL,
    LIGHT_CHASE,
    TASKS,
    TaskError,
    TaskSettings,
    default_body,
    distance_score,
    get_task,
    playfield,
)

SECOND_SENSOR = {"carry_ball": Cell.TARGET_SENSOR, "obstacle_touch": Cell.TOUCH_SENSOR}


def _correct_parts(body, second):
    """The rule spelled out: one of each sensor the task needs, and two wheels."""
    parts = min(int((body == Cell.LIGHT_SENSOR).sum()), 1)
    parts += min(int((body == Cell.WHEEL).sum()), 2)
    return parts + (min(int((body == second).sum()), 1) if second else 0)


@pytest.mark.parametrize("name", TASKS)
def test_validity_and_credit_follow_the_rule(name, rng):
    task = TASKS[name]
    second = SECOND_SENSOR.get(name)
    target, touch = (1.0 if second == cell else 0.05 for cell in list(Cell)[3::2])
    shares = rng.dirichlet([2.0, 2.0, 1.0, target, 2.0, touch], size=300)
    bodies = np.stack([rng.choice(6, (3, 3), p=p) for p in shares])
    valid, credit = task.is_valid(bodies), task.partial_credit(bodies)
    for body, is_valid, fitness in zip(bodies, valid, credit, strict=True):
        parts = _correct_parts(body, second)
        others = set(SECOND_SENSOR.values()) - {second}
        foreign = any(bool((body == cell).any()) for cell in others)
        assert is_valid == (parts == (4 if second else 3) and not foreign)
        assert fitness == pytest.approx(0.01 * parts)
        if is_valid:
            task.check_body(parse_body(body))
        else:
            with pytest.raises(BodyError):
                task.check_body(parse_body(body))
    assert 20 < valid.sum() < 280


def test_the_message_says_which_parts_are_missing_and_how_many():
    with pytest.raises(BodyError) as caught:
        CARRY_BALL.check_body(parse_body(["W..", "...", "..."]))
    text = str(caught.value)
    assert "1 ball sensor (code 2), has 0" in text
    assert "1 target sensor (code 3), has 0" in text
    assert "2 wheels (code 4), has 1" in text


@pytest.mark.parametrize(
    ("name", "title", "sensor"),
    [
        ("light_chase", "LightChase", "light sensor"),
        ("obstacle", "Obstacle", "light sensor"),
        ("carry_ball", "CarryBall", "ball sensor"),
    ],
)
def test_names_for_people(name, title, sensor):
    task = TASKS[name]
    assert task.title == title
    assert task.env_id == f"NCRS-{title}-v0"
    assert task.cell_label(Cell.LIGHT_SENSOR) == sensor
    assert task.cell_label(Cell.TARGET_SENSOR) == "target sensor"
    assert task.cell_label(Cell.WHEEL) == "wheel"


def test_a_target_sensor_is_foreign_to_light_chase():
    with pytest.raises(BodyError, match=r"cannot hold target sensor cells \(code 3, found 1\)"):
        LIGHT_CHASE.check_body(parse_body(["LTW", "W..", "..."]))


@pytest.mark.parametrize(("n", "extent"), [(3, 50.0), (4, 55.0), (5, 60.0), (9, 80.0), (15, 110.0)])
def test_playfield(n, extent):
    assert playfield(n) == extent


def test_distance_scores():
    assert distance_score(0.0, 60.0) == 1.0
    assert distance_score(30.0, 60.0) == pytest.approx(math.exp(-0.5))
    assert distance_score(30.0, 60.0, "inverse_square") == pytest.approx(1.0 / 2.25)


@pytest.mark.parametrize("name", TASKS)
@pytest.mark.parametrize("n", [3, 4, 5, 8])
def test_the_default_body_is_valid_at_every_size(name, n):
    body = default_body(TASKS[name], n)
    assert body.shape == (n, n)
    assert bool(TASKS[name].is_valid(body))


def test_parts_are_in_the_order_of_the_channels():
    assert [int(c) for c in LIGHT_CHASE.part_cells] == [1, 2, 4]
    assert [int(c) for c in CARRY_BALL.part_cells] == [1, 2, 3, 4]
    assert (LIGHT_CHASE.min_sensors, CARRY_BALL.min_sensors) == (1, 2)


def test_settings_default_to_the_tasks_radius():
    assert TaskSettings("light_chase").radius == 20.0
    assert TaskSettings("carry_ball").radius == 10.0
    assert TaskSettings("obstacle", success_radius=3).radius == 3.0


@pytest.mark.parametrize("radius", [0.0, -1.0, math.nan, math.inf, "20", True])
def test_bad_success_radii_are_refused(radius):
    with pytest.raises(TaskError, match="success_radius must be"):
        TaskSettings("light_chase", success_radius=radius)


def test_unknown_names_are_refused_with_the_known_ones():
    with pytest.raises(TaskError, match=r"Unknown task 'chase'.*light_chase"):
        get_task("chase")
    with pytest.raises(TaskError, match="exponential"):
        TaskSettings("light_chase", distance_score="linear")
