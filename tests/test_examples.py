"""The examples keep running, and the Braitenberg vehicle keeps solving LightChase."""

import dataclasses
import runpy
from pathlib import Path

import numpy as np
import pytest
import torch

import ncrs_envs
from ncrs_envs.tasks import PAPER_TASKS

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.fixture(scope="module")
def baselines():
    return runpy.run_path(str(EXAMPLES / "baselines.py"))


def test_the_braitenberg_vehicle_solves_light_chase(baselines):
    body = ncrs_envs.parse_body(baselines["BODIES"]["light_chase"])
    controller = baselines["braitenberg"](body, baselines["GAIN"]["light_chase"])
    fitness, successes = baselines["run"]("light_chase", controller, 8)
    assert fitness > 0.68
    assert successes == 8


@pytest.mark.parametrize("task", [task.name for task in PAPER_TASKS])
def test_all_bodies_suit_their_task(baselines, task):
    fitness, _ = baselines["run"](task, baselines["full_throttle"], 1)
    assert 0.1 < fitness < 0.8


def test_steering_by_the_target_carries_more_balls_than_chasing_them(baselines):
    body = ncrs_envs.parse_body(baselines["BODIES"]["carry_ball"])
    gain = baselines["GAIN"]["carry_ball"]
    successes = []
    for name in ("braitenberg", "catch_and_carry"):
        _, count = baselines["run"]("carry_ball", baselines[name](body, gain), 24)
        successes.append(count)
    assert successes[0] < successes[1]


def test_an_arrow_at_full_throttle_gets_further_in_obstacle_than_steering(baselines):
    body = ncrs_envs.parse_body(baselines["BODIES"]["obstacle"])
    vehicle = baselines["braitenberg"](body, baselines["GAIN"]["obstacle"])
    _, steering = baselines["run"]("obstacle", vehicle, 64)
    _, sliding = baselines["run"]("obstacle", baselines["full_throttle"], 64, baselines["ARROW"])
    assert steering < sliding


@pytest.fixture(scope="module")
def ppo():
    return runpy.run_path(str(EXAMPLES / "ppo.py"), run_name="ppo")


def test_advantages_by_hand(ppo):
    settings = ppo["Settings"](gamma=0.5, gae_lambda=0.5)
    rewards = torch.tensor([[1.0], [0.0], [2.0]])
    values = torch.tensor([[0.5], [1.0], [0.0]])
    # Surprises 1, -1 and 2; each counts a quarter as much one step earlier.
    expected = torch.tensor([[1.0 - 0.25 + 0.125], [-1.0 + 0.5], [2.0]])
    torch.testing.assert_close(ppo["advantages"](rewards, values, settings), expected)


@pytest.mark.parametrize(
    "task", ["light_chase", pytest.param("carry_ball", marks=pytest.mark.slow)]
)
def test_ppo_trains_and_writes_its_curve(ppo, task, tmp_path):
    curve = tmp_path / "curve.csv"
    recipe = ppo["RECIPES"][task]
    assert recipe.recurrent == (task != "light_chase")
    settings = dataclasses.replace(recipe, envs=8, steps=1600, test_episodes=8)
    _, successes = ppo["train"](settings, curve)
    assert 0 <= successes <= 8
    rows = curve.read_text().splitlines()
    assert rows[0] == "steps,seconds,return,success"
    assert [int(row.split(",")[0]) for row in rows[1:]] == [800, 1600]


@pytest.mark.slow
def test_ppo_solves_light_chase(ppo):
    _, successes = ppo["train"](ppo["RECIPES"]["light_chase"])
    assert successes >= 980


def _rows(curve):
    return [line.split(",") for line in curve.read_text().splitlines()]


@pytest.mark.parametrize("envs", [1, 8])
def test_sb3s_ppo_trains_on_one_environment_and_on_many(envs, tmp_path):
    pytest.importorskip("stable_baselines3")
    example = runpy.run_path(str(EXAMPLES / "sb3_ppo.py"), run_name="sb3_ppo")
    model = example["train"](envs, 1600, 0, tmp_path / "curve.csv")
    assert 0 <= example["count_successes"](model, 8) <= 8
    header, *rows = _rows(tmp_path / "curve.csv")
    assert header == ["steps", "seconds", "success"]
    assert int(rows[-1][0]) == 1600


def test_one_policy_trains_on_many_bodies(tmp_path):
    example = runpy.run_path(str(EXAMPLES / "body_conditioned.py"), run_name="body_conditioned")
    bodies = example["random_bodies"](np.random.default_rng(0), 20)
    assert len(np.unique(bodies, axis=0)) == 20
    np.testing.assert_array_equal(bodies, bodies[:, :, ::-1])
    policy = example["train"](2, 8, 0, tmp_path / "curve.csv")
    assert 0 <= example["count_successes"](policy, 8) <= 8
    assert [int(row[0]) for row in _rows(tmp_path / "curve.csv")[1:]] == [800, 1600]


def test_evotorch_searches(tmp_path):
    pytest.importorskip("evotorch")
    example = runpy.run_path(str(EXAMPLES / "evotorch_search.py"), run_name="evotorch_search")
    genome = example["search"](2, 0, tmp_path / "curve.csv")
    assert genome.shape == (1, 4572)
    assert [row[0] for row in _rows(tmp_path / "curve.csv")] == ["generation", "0", "1"]
