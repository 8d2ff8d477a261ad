"""The page runs what training ran: recorded episodes, replayed in Chromium."""

from dataclasses import replace

import numpy as np
import pytest

import ncrs
from ncrs.automaton.regrow_to import REPAIR_STEPS
from ncrs.live.world import live_world, placements
from ncrs.report.encoding import pack
from ncrs_envs import Damage, Repair, sample_scenarios
from ncrs_envs.tasks import TaskSettings
from tests.live.replay import REPLAY, champions_of, compare, mixed_robots, valid_robots

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


def test_a_robot_is_cut_and_grows_back_as_in_training(live):
    """The cut of the page is the damage of a scenario, and its repair the same, too."""
    genome = ncrs.load_champion("light_chase/repair").genome
    settings = TaskSettings("light_chase")
    drawn = sample_scenarios("light_chase", 2, 4)
    scenarios = [
        replace(scenario, damage=Damage(5 * column, [(1, 1), (2, 2), (2, column)]), repair=repair)
        for column, scenario in zip((0, 1, 3, 4), drawn, strict=True)
        for repair in (None, Repair(REPAIR_STEPS))
    ]
    expected = ncrs.evaluate(genome, "light_chase", engine="batched", scenarios=scenarios)
    assert expected.recovered[0].tolist() == [0.0, 1.0] * 4
    replayed = live.js(
        REPLAY,
        live_world(settings, []),
        [pack(genome)],
        [
            {
                **placements(scenario, 5, None),
                "damage": {
                    "step": scenario.damage.step,
                    "cells": [5 * row + column for row, column in scenario.damage.cells],
                },
                "repairSteps": REPAIR_STEPS if scenario.repair else 0,
            }
            for scenario in scenarios
        ],
    )[0]
    fitness = [episode["fitness"] for episode in replayed]
    np.testing.assert_allclose(fitness, expected.episode_fitness[0], atol=1e-9)
    lost = [sum(code == 0 for code in episode["body"]) for episode in replayed]
    whole = int((expected.bodies[0] == 0).sum())
    assert lost[1::2] == [whole] * 4
    assert lost[::2] == [whole + len(s.damage.cells) for s in scenarios[::2]]
