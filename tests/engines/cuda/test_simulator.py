"""The kernels of the engine ``cuda`` in numba-cuda's simulator, against the engine ``batched``."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from ncrs.engines.batched import BatchedEngine

from .cases import EPISODES, GIVEN, TASKS, evaluate

pytest.importorskip("numba_cuda", reason="needs the extra cuda")


def simulated(task, path):
    script = Path(__file__).with_name("cases.py")
    environment = {**os.environ, "NUMBA_ENABLE_CUDASIM": "1", "NCRS_QUIET": "1"}
    subprocess.run([sys.executable, script, path, task], check=True, env=environment, timeout=240)
    return np.load(path)


@pytest.mark.parametrize(
    "task",
    [
        "obstacle",
        pytest.param("light_chase", marks=pytest.mark.slow),
        pytest.param("carry_ball", marks=pytest.mark.slow),
    ],
)
def test_growth_control_and_contacts_are_bit_equal(task, tmp_path):
    results = simulated(task, tmp_path / "results.npz")
    expected = evaluate(BatchedEngine, "ncrs.engines.batched", task)
    assert expected.valid.tolist() == [True, task in GIVEN]
    assert expected.episode_fitness.shape == (2, EPISODES[task])
    for name, value in vars(expected).items():
        np.testing.assert_array_equal(results[name], value, err_msg=name)
    if task not in GIVEN:
        assert results["copied"] == 0
        np.testing.assert_array_equal(results["bodies_of_device_genomes"], expected.bodies)


@pytest.mark.parametrize("task", TASKS)
def test_the_cases_touch_something(task, monkeypatch):
    """A free robot would not show whether contacts are right."""
    from ncrs_envs.batched.dtypes import records
    from ncrs_envs.batched.layout import State
    from ncrs_envs.batched.records import single_world
    from ncrs_envs.batched.simulate import reset_episode, step_episode
    from ncrs_envs.tasks import TaskSettings

    from .cases import scenarios

    body = evaluate(BatchedEngine, "ncrs.engines.batched", task).bodies[0]
    for case in scenarios(task):
        world = single_world(TaskSettings(task), body, case)
        state, observation = records(State, 1)[0], np.zeros(25)
        reset_episode(world, state, observation)
        touched = False
        for _ in range(3):
            step_episode(world, state, np.ones(25), observation)
            touched = touched or bool(state.touched)
        assert touched
