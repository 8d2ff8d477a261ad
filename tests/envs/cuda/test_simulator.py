"""The environments on a GPU, in numba-cuda's simulator, against those on the CPU."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest
import torch

import ncrs_envs
from ncrs_envs import ActionError, OptionError, get_task, parse_body
from ncrs_envs.sb3 import SB3VecEnv
from ncrs_envs.wrappers import vector
from ncrs_envs.wrappers.signals import ViewError

from .rehearsal import COUNT, LIMIT, MODES, STEPS, TASKS, body, record, scenario, variations

pytest.importorskip("numba_cuda", reason="needs the extra cuda")


def simulated(path, *arguments):
    script = Path(__file__).with_name("rehearsal.py")
    environment = {**os.environ, "NUMBA_ENABLE_CUDASIM": "1", "NCRS_QUIET": "1"}
    command = [sys.executable, script, path, *arguments]
    subprocess.run(command, check=True, env=environment, timeout=240)
    return np.load(path)


def assert_equal(results, expected):
    for name, value in expected.items():
        np.testing.assert_array_equal(results[name], value, err_msg=name)
        assert results[name].dtype == value.dtype, name


def case(task, mode, *, slow=False):
    return pytest.param(task, mode, marks=[pytest.mark.slow] if slow else [])


@pytest.mark.parametrize(
    ("task", "mode"),
    [
        case("light_chase", "SameStep"),
        case("obstacle", "NextStep"),
        case("carry_ball", "Disabled"),
        *(case(task, mode, slow=True) for task in TASKS for mode in MODES),
    ],
)
def test_every_step_is_bit_equal(task, mode, tmp_path):
    expected = record(task, mode, "cpu")
    assert expected["0.0"].shape == (COUNT, 5, 5)
    assert f"{STEPS - 1}.4.pose" in expected
    assert_equal(simulated(tmp_path / "steps.npz", task, mode), expected)


def test_other_arguments_and_options_are_bit_equal(tmp_path, monkeypatch):
    monkeypatch.setattr(ncrs_envs.TASKS, "_entries", dict(ncrs_envs.TASKS._entries))
    expected = variations("cpu")
    gymnasium.registry.pop("Mine-v0")
    assert expected["small 0.2"].tolist() == [False, True, False]  # by success
    assert expected["one ends.4._final_obs"].tolist() == [False, True]
    assert_equal(simulated(tmp_path / "steps.npz", "variations", ""), expected)


@pytest.mark.parametrize("task", TASKS[:3])
def test_the_robots_touch_something(task):
    """A free robot would not show whether contacts are right."""
    envs = gymnasium.make_vec(get_task(task).env_id, num_envs=1, body=body(task))
    envs.reset(options={"scenario": scenario(task)})
    touched = False
    for _ in range(LIMIT):
        envs.step(np.ones((1, 5, 5), np.float32))
        touched = touched or bool(envs._batch._episodes.states[0].touched)
    assert touched


def test_what_a_gpu_cannot_do_is_refused_with_the_reason(tmp_path):
    errors = simulated(tmp_path / "errors.npz", "refusals", "")
    expected = {
        "step before reset": ("ResetNeeded", "environment 0 has no episode"),
        "on the CPU's side": ("ActionError", "must be a tensor on cpu, or have __dlpack__"),
        "shape": ("ActionError", r"must have shape \(5, 5, 5\).*got \(5, 25\)"),
        "complex": ("ActionError", "real numbers, got dtype torch.complex64"),
        "not finite": ("ActionError", r"finite, got nan at \(2, 0, 1\)"),
        "ended": ("ResetNeeded", "Episodes have ended in 5 environments, the first of them 0"),
        "damage": ("OptionError", "Nothing is damaged or disturbed on a GPU"),
        "too many": ("OptionError", r"needs about [\d.]+ GB .* environments fit"),
        "sparse": ("ActionError", "a dense tensor of real numbers"),
        "threads": ("OptionError", "threads: for environments on the CPU only"),
        "placed": ("TaskError", "placed draws its placements in Python"),
        "copied": ("TypeError", "neither pickled nor copied"),
        "closed": ("ClosedEnvironmentError", "has been closed"),
        "stream": ("NoGeneratorError", "random streams"),
    }
    assert set(errors.files) == set(expected)
    for name, (kind, text) in expected.items():
        found_kind, found_text = errors[name].tolist()
        assert found_kind == kind, name
        assert re.search(text, found_text), found_text


@pytest.mark.parametrize("device", ["tpu", "mps", 3.5])
def test_unknown_devices_are_refused(device):
    with pytest.raises(OptionError, match="device must be 'cpu', 'cuda' or 'cuda:INDEX'"):
        gymnasium.make_vec("NCRS-Obstacle-v0", num_envs=2, device=device)


def test_nothing_is_drawn_on_a_gpu():
    with pytest.raises(OptionError, match="render_mode must be None on a GPU"):
        gymnasium.make_vec("NCRS-Obstacle-v0", 2, device="cuda", render_mode="rgb_array")


def test_a_missing_gpu_is_said():
    if torch.cuda.is_available():
        pytest.skip("there is a GPU")
    with pytest.raises(OptionError, match="device='cuda' needs a GPU that torch can use"):
        gymnasium.make_vec("NCRS-LightChase-v0", num_envs=2, device="cuda")


def test_wrappers_that_compute_with_numpy_refuse_environments_on_a_gpu():
    envs = gymnasium.make_vec("NCRS-LightChase-v0", num_envs=2)
    envs.device = "cuda:0"
    for wrapper in (vector.FixedBodyView, vector.SensorDifferences, SB3VecEnv):
        with pytest.raises(ViewError, match=r"computes with numpy, and .* are on cuda:0"):
            wrapper(envs)


def test_the_cpu_takes_tensors_too():
    envs = gymnasium.make_vec("NCRS-LightChase-v0", num_envs=2, device="cpu")
    envs.reset(seed=0)
    envs.step(torch.ones(2, 5, 5, requires_grad=True))
    with pytest.raises(ActionError, match="real numbers"):
        envs.step(torch.ones(2, 5, 5, dtype=torch.bfloat16))


def test_a_spec_with_tensors_can_be_written_as_json():
    grid = torch.tensor(parse_body("LWL/W#W/.W."))
    device = torch.device("cpu")
    envs = gymnasium.make_vec("NCRS-LightChase-v0", num_envs=2, body=grid.numpy(), device=device)
    written = json.loads(envs.spec.to_json())["kwargs"]
    assert (written["body"], written["device"]) == (grid.tolist(), "cpu")
