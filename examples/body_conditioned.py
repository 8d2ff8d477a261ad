"""One policy for many bodies: PPO on robots that all differ.

Every environment has a body of its own. The policy sees sensors and body as a grid, decides on the
gas of every wheel, and is tested on bodies that it has never driven:

    python examples/body_conditioned.py
"""

from __future__ import annotations

import argparse
import csv
import time
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.distributions import Normal

from ncrs.runs.statistics import wilson_interval
from ncrs_envs import Cell, body_measures, get_task
from ncrs_envs.tasks import MAX_EPISODE_STEPS
from ncrs_envs.wrappers.vector import BodyConditionedView, ProgressReward

TASK = get_task("light_chase")
SIDE = 5
ROLLOUTS = 100
ENVS = 512
GAMMA, GAE_LAMBDA, CLIP, EPOCHS, MINIBATCHES = 0.98, 0.95, 0.2, 4, 16
CONTRAST, CHANGE = 30.0, 50.0
"""Factors of a sensor's difference from the mean of all, and of its change."""
CODES = [int(cell) for cell in (Cell.EMPTY, *TASK.part_cells)]
FEATURES = len(CODES) + 3


def random_bodies(rng: np.random.Generator, count: int) -> NDArray[np.int8]:
    """Draw valid mirror-symmetric bodies, 4 sensors and 4 wheels or more, ``(count, 5, 5)``."""
    found: list[NDArray[np.int8]] = []
    while len(found) < count:
        half = rng.choice(CODES, size=(count, SIDE, 3), p=[0.25, 0.15, 0.2, 0.4])
        bodies = np.concatenate([half, half[:, :, 1::-1]], axis=2).astype(np.int8)
        sensors, wheels, _ = body_measures(bodies).T
        found += list(bodies[TASK.is_valid(bodies) & (sensors >= 4) & (wheels >= 4)])
    return np.stack(found[:count])


class Policy(nn.Module):
    """Two layers over all cells of the grid; a gas for each cell, and a value."""

    def __init__(self, width: int = 128) -> None:
        super().__init__()
        cells = SIDE * SIDE

        def layers(outputs: int) -> nn.Sequential:
            hidden = (nn.Linear(FEATURES * cells, width), nn.Tanh(), nn.Linear(width, width))
            last = nn.Linear(width, outputs)
            nn.init.zeros_(last.weight)
            return nn.Sequential(nn.Flatten(), *hidden, nn.Tanh(), last)

        self.actor, self.critic = layers(cells), layers(1)
        self.log_std = nn.Parameter(torch.tensor(-0.5))

    def forward(self, features: Tensor) -> tuple[Normal, Tensor]:
        """Return the distribution of the gas ``(B, 5, 5)`` and the value ``(B,)``."""
        mean = self.actor(features).reshape(-1, SIDE, SIDE)
        return Normal(mean, self.log_std.exp()), self.critic(features)[:, 0]


class Batch(NamedTuple):
    """One episode of every environment, steps first."""

    features: Tensor
    wheels: Tensor
    actions: Tensor
    logs: Tensor
    values: Tensor
    rewards: Tensor
    success: NDArray[np.bool_]


def features(observation: dict[str, Any], before: NDArray[np.float32]) -> Tensor:
    """Stack body, mean of the sensors, contrasts and changes as channels, ``(N, 8, 5, 5)``."""
    sensors, body = observation["sensors"], observation["body"]
    senses = body == Cell.LIGHT_SENSOR
    mean = sensors.sum(axis=(1, 2)) / senses.sum(axis=(1, 2))
    contrast = np.where(senses, CONTRAST * (sensors - mean[:, None, None]), 0.0)
    change = CHANGE * (sensors - before)
    everywhere = np.broadcast_to(mean[:, None, None], sensors.shape)
    layers = [*(body == code for code in CODES), everywhere, contrast, change]
    return torch.from_numpy(np.stack(layers, axis=1).astype(np.float32))


def log_prob(distribution: Normal, actions: Tensor, wheels: Tensor) -> Tensor:
    """Sum the log-probabilities of the gas in wheel cells."""
    total: Tensor = (distribution.log_prob(actions) * wheels).sum(dim=(1, 2))
    return total


def roll_out(envs: Any, policy: Policy, options: dict[str, Any], *, greedy: bool = False) -> Batch:
    """Run one episode of every environment."""
    observation, info = envs.reset(seed=options["seed"], options={"body": options["body"]})
    wheels = torch.from_numpy((observation["body"] == Cell.WHEEL).astype(np.float32))
    before, steps = observation["sensors"].copy(), []
    with torch.no_grad():
        for _ in range(MAX_EPISODE_STEPS):
            seen = features(observation, before)
            distribution, value = policy(seen)
            action = distribution.mean if greedy else distribution.sample()
            before = observation["sensors"].copy()
            observation, reward, _, _, info = envs.step(action.numpy())
            log = log_prob(distribution, action, wheels)
            steps.append((seen, wheels, action, log, value, torch.from_numpy(reward).float()))
    columns = (torch.stack(column) for column in zip(*steps, strict=True))
    return Batch(*columns, success=info["success"].copy())


def improve(policy: Policy, optimizer: torch.optim.Optimizer, batch: Batch) -> None:
    """Run several epochs of PPO's clipped surrogate (Schulman et al. 2017, equation 7)."""
    gains, ahead = torch.zeros_like(batch.rewards), torch.zeros(batch.rewards.shape[1])
    running = torch.zeros(batch.rewards.shape[1])
    for step in reversed(range(len(gains))):
        surprise = batch.rewards[step] + GAMMA * ahead - batch.values[step]
        running = surprise + GAMMA * GAE_LAMBDA * running
        gains[step], ahead = running, batch.values[step]
    columns = [*batch[:4], gains, gains + batch.values]
    columns = [column.flatten(0, 1) for column in columns]
    for _ in range(EPOCHS):
        for chosen in torch.randperm(len(columns[0])).chunk(MINIBATCHES):
            seen, wheels, actions, logs, gain, target = (column[chosen] for column in columns)
            distribution, value = policy(seen)
            ratio = (log_prob(distribution, actions, wheels) - logs).exp()
            gain = (gain - gain.mean()) / (gain.std() + 1e-8)
            clipped = ratio.clamp(1.0 - CLIP, 1.0 + CLIP)
            loss = -torch.min(ratio * gain, clipped * gain).mean()
            loss = loss + 0.5 * (value - target).square().mean()
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(policy.parameters(), 0.5)
            optimizer.step()


def train(rollouts: int, count: int, seed: int, curve: Path | None = None) -> Policy:
    """Train on new bodies in every rollout, print, and optionally save the curve."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    policy = Policy()
    optimizer = torch.optim.Adam(policy.parameters(), lr=1e-3, eps=1e-5)
    envs = make_envs(count)
    rows, start = [], time.perf_counter()
    for index in range(rollouts):
        for group in optimizer.param_groups:
            group["lr"] = 1e-3 * (1.0 - index / rollouts)
        options = {"seed": int(rng.integers(2**31)), "body": random_bodies(rng, count)}
        batch = roll_out(envs, policy, options)
        improve(policy, optimizer, batch)
        steps, seconds = (index + 1) * count * MAX_EPISODE_STEPS, time.perf_counter() - start
        rows.append((steps, seconds, float(batch.success.mean())))
        if (index + 1) % max(1, rollouts // 20) == 0:
            print(f"{steps:>11,} steps  {seconds:6.1f} s  success {rows[-1][2]:6.1%}", flush=True)
    envs.close()
    if curve is not None:
        with curve.open("w", newline="", encoding="utf-8") as stream:
            csv.writer(stream).writerows([("steps", "seconds", "success"), *rows])
    return policy


def make_envs(count: int) -> Any:
    """Make environments that show their bodies and reward progress."""
    envs = gymnasium.make_vec(TASK.env_id, count)
    return ProgressReward(BodyConditionedView(envs))


def count_successes(policy: Policy, episodes: int) -> int:
    """Count the successes without exploration noise, on bodies and scenarios not seen before."""
    options = {"seed": 1_000_000, "body": random_bodies(np.random.default_rng(10**6), episodes)}
    envs = make_envs(episodes)
    batch = roll_out(envs, policy, options, greedy=True)
    envs.close()
    return int(batch.success.sum())


def main() -> None:
    """Read the command line, train, and test."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rollouts", type=int, default=ROLLOUTS)
    parser.add_argument("--envs", type=int, default=ENVS)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--curve", type=Path, help="CSV file for the learning curve")
    options = parser.parse_args()
    policy = train(options.rollouts, options.envs, options.seed, options.curve)
    successes = count_successes(policy, 1000)
    low, high = wilson_interval(successes, 1000)
    interval = f"95 % interval {low:.1%} to {high:.1%}"
    print(f"On 1,000 new bodies, {successes} episodes succeed ({interval}).")


if __name__ == "__main__":
    main()
