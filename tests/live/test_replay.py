"""The page runs what training ran: recorded episodes, replayed in Chromium."""

import numpy as np
import pytest

from tests.live.replay import champions_of, compare, mixed_robots, valid_robots

TASKS = ("light_chase", "obstacle", "carry_ball")


def check(found):
    assert found.bodies.all()
    assert found.position_before_contact.max() < 1e-6
    assert found.fitness.mean() < 1e-3
    assert found.success.mean() >= 0.99
    assert found.crossed.mean() >= 0.99


@pytest.mark.parametrize("task", TASKS)
def test_champions_drive_as_in_training(live, task):
    robots = valid_robots(task, 5, champions_of(task)[:2])
    found = compare(live, task, robots, 4)
    assert len(found.success) == 8
    check(found)


@pytest.mark.slow
def test_larger_bodies_grow_and_drive_as_in_training(live):
    check(compare(live, "obstacle", valid_robots("obstacle", 9, champions_of("obstacle")), 1, 9))


@pytest.mark.slow
@pytest.mark.parametrize("task", TASKS)
def test_a_hundred_episodes_of_each_task(live, task):
    robots = mixed_robots(task, 5, random=8, changed=8)
    found = compare(live, task, robots, 8)
    assert len(found.success) >= 100
    assert found.touched.sum() >= 10
    check(found)
    print(
        f"{task}: {len(found.success)} episodes, {found.touched.sum()} with contacts, positions "
        f"{found.position_before_contact.max():.1e}, fitness {found.fitness.mean():.1e}, "
        f"success {np.mean(found.success):.1%}"
    )


@pytest.mark.slow
@pytest.mark.parametrize("task", TASKS)
def test_seven_by_seven_cells(live, task):
    check(compare(live, task, mixed_robots(task, 7, random=2, changed=3), 4, 7))
