"""Recordings on Box2D show what the engine evaluates."""

import dataclasses
import math

import numpy as np
import pytest

import ncrs
from ncrs.automaton.control import StateError
from ncrs.viz.recording import record, record_episodes
from ncrs_envs import PerturbationSettings
from ncrs_envs.scenario import ScenarioError, sample_scenarios
from ncrs_envs.tasks import PAPER_TASKS


@pytest.mark.parametrize("task", [task.name for task in PAPER_TASKS])
def test_a_recorded_episode_earns_what_the_engine_says(task):
    robot = ncrs.load_champion(f"{task}/best")
    scenarios = sample_scenarios(task, 5, 3)
    evaluated = ncrs.evaluate(robot.genome, task, engine="box2d", scenarios=scenarios)
    recordings = record(robot, scenarios)
    assert [r.fitness for r in recordings] == evaluated.episode_fitness[0].tolist()
    assert [r.success for r in recordings] == evaluated.success[0].tolist()
    means = [r.rewards.mean() for r in recordings]
    np.testing.assert_allclose(means, evaluated.episode_fitness[0], rtol=1e-13)
    assert [r.scenario for r in recordings] == scenarios


def test_a_recording_has_every_moment():
    robot = ncrs.load_champion("light_chase/best")
    recording, _ = record_episodes(robot, 2, seed=0)
    assert len(recording.scenes) == len(recording.states) == 101
    assert recording.rewards.shape == (100,)
    first, last = recording.scenes[0], recording.scenes[-1]
    assert first.pose == (*recording.scenario.start, 0.0)
    assert (first.action == 0.0).all()
    assert len(first.path) == 1
    assert len(last.path) == 101
    assert tuple(last.path[-1]) == last.pose[:2]
    np.testing.assert_array_equal(recording.states[0, ..., 0], robot.body != 0)
    # The gas of a moment is in the input/output channel of the wheels.
    wheels = robot.body == 4
    np.testing.assert_array_equal(last.action[wheels], recording.states[-1][wheels][:, -1])


def test_scenarios_of_another_task_are_refused():
    robot = ncrs.load_champion("light_chase/best")
    with pytest.raises(ScenarioError):
        record(robot, sample_scenarios("carry_ball", 0, 1))


def test_a_state_that_overflows_is_an_error():
    robot = ncrs.load_champion("light_chase/best")
    genome = np.random.default_rng(0).choice([-1e38, 1e38], robot.genome.size).astype(np.float32)
    with pytest.raises(StateError, match="no longer finite"):
        record_episodes(dataclasses.replace(robot, genome=genome), 1, seed=0)


def test_damage_and_repair_are_recorded():
    settings = PerturbationSettings(damage_fraction=0.3, damage_step=3, repair_steps=4)
    robot = ncrs.load_champion("light_chase/best")
    (recording,) = record_episodes(robot, 1, seed=2, perturbations=settings)
    cells = [int((scene.body != 0).sum()) for scene in recording.scenes]
    whole = cells[0]
    assert cells[:3] == [whole] * 3
    assert set(cells[3:5]) == {whole - math.ceil(0.3 * whole)}
    result = ncrs.evaluate(
        robot.genome, robot.task.name, engine="box2d", scenarios=[recording.scenario]
    )
    assert recording.fitness == result.fitness[0]
