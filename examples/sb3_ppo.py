"""PPO of Stable-Baselines3, on one environment or on the batched simulator.

Needs the extra ``sb3``. Both learn to chase a light; the batched simulator takes minutes, one
environment at a time takes an hour:

    python examples/sb3_ppo.py --envs 256
    python examples/sb3_ppo.py --envs 1
"""

from __future__ import annotations

import argparse
import csv
import time
from pathlib import Path
from typing import Any

import gymnasium
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecMonitor

import ncrs_envs.wrappers
import ncrs_envs.wrappers.vector
from ncrs.runs.statistics import wilson_interval
from ncrs_envs.sb3 import SB3VecEnv

BODY = [".....", "LWWWL", "WWWWW", "WWWWW", "L...L"]
STEPS = 2_048_000
"""Environment steps for many environments; one environment learns from fewer, but not faster."""
TEST_EPISODES = 1000


def make_envs(count: int) -> VecEnv:
    """Make the environments with the views and aids that the policy learns from."""
    if count == 1:
        return VecMonitor(DummyVecEnv([_one]), info_keywords=("success",))
    from ncrs_envs.wrappers import vector

    envs: Any = gymnasium.make_vec(
        "NCRS-LightChase-v0", count, body=BODY, autoreset_mode="SameStep"
    )
    envs = vector.DifferentialDrive(vector.SensorDifferences(vector.FixedBodyView(envs)))
    return VecMonitor(SB3VecEnv(vector.ProgressReward(envs)), info_keywords=("is_success",))


def _one() -> gymnasium.Env[Any, Any]:
    env: gymnasium.Env[Any, Any] = gymnasium.make("NCRS-LightChase-v0", body=BODY)
    single = ncrs_envs.wrappers
    env = single.DifferentialDrive(single.SensorDifferences(single.FixedBodyView(env)))
    return single.ProgressReward(env)


class Curve(BaseCallback):
    """Keeps the success of the last episodes after every rollout."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[tuple[float, ...]] = []
        self._start = time.perf_counter()

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        episodes = self.model.ep_info_buffer or []
        if episodes:
            solved = [float(e.get("success", e.get("is_success", 0.0))) for e in episodes]
            seconds = time.perf_counter() - self._start
            self.rows.append((self.num_timesteps, seconds, sum(solved) / len(solved)))


def train(count: int, steps: int, seed: int, curve: Path | None = None) -> PPO:
    """Train, and optionally save the curve."""
    torch.set_num_threads(1)  # with networks this small threads wait longer than they compute
    envs = make_envs(count)
    rollout = 100 if count > 1 else 1600
    model = PPO(
        "MlpPolicy", envs, seed=seed, device="cpu", n_steps=rollout,
        batch_size=max(64, count * rollout // 8), n_epochs=4, gamma=0.98,
        learning_rate=lambda left: 1e-3 * left, stats_window_size=max(100, count),
    )  # fmt: skip
    recorded = Curve()
    model.learn(steps, callback=recorded)
    envs.close()
    if curve is not None:
        with curve.open("w", newline="", encoding="utf-8") as stream:
            csv.writer(stream).writerows([("steps", "seconds", "success"), *recorded.rows])
    return model


def count_successes(model: PPO, episodes: int) -> int:
    """Count the successes in fresh episodes, without exploration noise."""
    envs = make_envs(episodes)
    envs.seed(1_000_000)
    observations: Any = envs.reset()
    solved = 0
    for _ in range(100):
        actions, _ = model.predict(observations, deterministic=True)
        observations, _, dones, infos = envs.step(actions)
        solved += sum(bool(infos[index]["is_success"]) for index in dones.nonzero()[0])
    envs.close()
    return solved


def main() -> None:
    """Read the command line, train, and test."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--envs", type=int, default=256)
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--curve", type=Path, help="CSV file for the learning curve")
    options = parser.parse_args()
    start = time.perf_counter()
    model = train(options.envs, options.steps, options.seed, options.curve)
    seconds = time.perf_counter() - start
    solved = count_successes(model, TEST_EPISODES)
    low, high = wilson_interval(solved, TEST_EPISODES)
    print(
        f"After {options.steps:,} steps in {seconds:.0f} s, {solved} of {TEST_EPISODES} episodes "
        f"succeed (95 % interval {low:.1%} to {high:.1%})."
    )


if __name__ == "__main__":
    main()
