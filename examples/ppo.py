"""PPO on thousands of robots at once, in one file: the batched simulator, numpy and torch.

LightChase in under a minute, CarryBall with a recurrent policy in minutes, on two cores:

    python examples/ppo.py
    python examples/ppo.py --task carry_ball

Every rollout is one whole episode of every environment, 100 steps, so nothing needs bootstrapping.
Source: Schulman et al. 2017, equations 7 and 11.
"""

from __future__ import annotations

import argparse
import csv
import time
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import gymnasium
import torch
from torch import Tensor, nn
from torch.distributions import Normal

import ncrs_envs
from ncrs.runs.statistics import wilson_interval
from ncrs_envs.tasks import MAX_EPISODE_STEPS
from ncrs_envs.wrappers.vector import (
    DifferentialDrive,
    FixedBodyView,
    ProgressReward,
    SensorDifferences,
)


@dataclass
class Settings:
    """One task's recipe; the command line changes any of it."""

    task: str = "light_chase"
    body: str = "...../LWWWL/WWWWW/WWWWW/L...L"
    seed: int = 0
    steps: int = 1_228_800
    """Environment steps."""
    envs: int = 512
    hidden: int = 64
    """Units of the two layers, or of the recurrent one."""
    recurrent: bool = False
    """Whether the policy has a memory, a gated recurrent unit."""
    success_bonus: float = 0.0
    learning_rate: float = 1e-3
    gamma: float = 0.98
    gae_lambda: float = 0.95
    clip: float = 0.2
    epochs: int = 4
    minibatches: int = 8
    entropy: float = 0.0
    test_episodes: int = 1000


RECIPES = {
    "light_chase": Settings(),
    "obstacle": Settings(
        task="obstacle", body="..W../.LWL./..W../..W../.WWW.", steps=10_240_000, envs=1024,
        hidden=96, recurrent=True, success_bonus=5.0,
    ),
    "carry_ball": Settings(
        task="carry_ball", body="T...T/WWWWW/WWWWW/.LWL./.....", steps=20_480_000, envs=1024,
        hidden=96, recurrent=True, success_bonus=5.0,
    ),
}  # fmt: skip


class Policy(nn.Module):
    """A Gaussian policy over the gas of the two sides, and a value, with or without memory."""

    def __init__(self, inputs: int, settings: Settings) -> None:
        super().__init__()
        width = settings.hidden
        self.recurrent = settings.recurrent
        if self.recurrent:
            self.memory = nn.GRU(inputs, width)
            self.actor: nn.Module = nn.Linear(width, 2)
            self.critic: nn.Module = nn.Linear(width, 1)
        else:
            self.actor, self.critic = (_layers(inputs, width, outputs) for outputs in (2, 1))
        self.log_std = nn.Parameter(torch.full((2,), -0.5))

    def forward(self, inputs: Tensor, memory: Tensor | None = None) -> tuple[Any, ...]:
        """Return action distribution, value ``(T, B)`` and memory for inputs ``(T, B, F)``."""
        if self.recurrent:
            inputs, memory = self.memory(inputs, memory)
        mean, value = self.actor(inputs), self.critic(inputs)[..., 0]
        return Normal(mean, self.log_std.exp()), value, memory


def _layers(inputs: int, width: int, outputs: int) -> nn.Module:
    layers = [nn.Linear(inputs, width), nn.Linear(width, width), nn.Linear(width, outputs)]
    for layer, gain in zip(layers, (2**0.5, 2**0.5, 0.01), strict=True):
        nn.init.orthogonal_(layer.weight, gain)
        nn.init.zeros_(layer.bias)
    return nn.Sequential(layers[0], nn.Tanh(), layers[1], nn.Tanh(), layers[2])


def make_envs(settings: Settings, count: int) -> Any:
    """Vector environments with the views and aids that the policy learns from."""
    env_id = ncrs_envs.get_task(settings.task).env_id
    envs = gymnasium.make_vec(env_id, count, body=settings.body.split("/"))
    view = DifferentialDrive(SensorDifferences(FixedBodyView(envs)))
    return ProgressReward(view, success_bonus=settings.success_bonus)


def advantages(rewards: Tensor, values: Tensor, settings: Settings) -> Tensor:
    """Generalized advantage estimates (Schulman et al. 2017, equation 11), ``(T, N)``."""
    result = torch.zeros_like(rewards)
    ahead, running = torch.zeros(rewards.shape[1]), torch.zeros(rewards.shape[1])
    for step in reversed(range(len(rewards))):
        surprise = rewards[step] + settings.gamma * ahead - values[step]
        running = surprise + settings.gamma * settings.gae_lambda * running
        result[step], ahead = running, values[step]
    return result


def roll_out(
    envs: Any, policy: Policy, seed: int | None = None, *, greedy: bool = False
) -> dict[str, Any]:
    """One episode of every environment; arrays are ``(T, N, ...)``."""
    observation, _ = envs.reset(seed=seed)
    steps, memory = MAX_EPISODE_STEPS, None
    seen = torch.zeros((steps, envs.num_envs, observation.shape[-1]))
    actions = torch.zeros((steps, envs.num_envs, 2))
    logs, values, rewards = (torch.zeros((steps, envs.num_envs)) for _ in range(3))
    with torch.no_grad():
        for step in range(steps):
            seen[step] = torch.from_numpy(observation)
            distribution, value, memory = policy(seen[step : step + 1], memory)
            action = distribution.mean if greedy else distribution.sample()
            actions[step], values[step] = action[0], value[0]
            logs[step] = distribution.log_prob(action).sum(-1)[0]
            observation, reward, _, _, info = envs.step(actions[step].numpy())
            rewards[step] = torch.from_numpy(reward)
    return {
        "seen": seen, "actions": actions, "logs": logs, "values": values, "rewards": rewards,
        "success": float(info["success"].mean()), "successes": int(info["success"].sum()),
    }  # fmt: skip


def improve(policy: Policy, optimizer: Any, batch: dict[str, Any], settings: Settings) -> None:
    """Several epochs on one rollout: the clipped surrogate (equation 7), values and entropy."""
    gains = advantages(batch["rewards"], batch["values"], settings)
    targets = gains + batch["values"]
    columns = [batch["seen"], batch["actions"], batch["logs"], gains, targets]
    if not policy.recurrent:  # steps are independent: all of them in one long row
        columns = [column.flatten(0, 1)[None] for column in columns]
    for _ in range(settings.epochs):
        for chosen in torch.randperm(columns[0].shape[1]).chunk(settings.minibatches):
            seen, actions, logs, gain, target = (column[:, chosen] for column in columns)
            distribution, value, _ = policy(seen)
            ratio = (distribution.log_prob(actions).sum(-1) - logs).exp()
            gain = (gain - gain.mean()) / (gain.std() + 1e-8)
            clipped = ratio.clamp(1.0 - settings.clip, 1.0 + settings.clip)
            loss = -torch.min(ratio * gain, clipped * gain).mean()
            loss = loss + 0.5 * (value - target).square().mean()
            loss = loss - settings.entropy * distribution.entropy().sum(-1).mean()
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(policy.parameters(), 0.5)
            optimizer.step()


def train(settings: Settings, curve: Path | None = None) -> tuple[Policy, int]:
    """Train, print and optionally save the curve; the policy and the successes of its test."""
    torch.manual_seed(settings.seed)
    envs, tests = make_envs(settings, settings.envs), make_envs(settings, settings.test_episodes)
    policy = Policy(envs.single_observation_space.shape[0], settings)
    optimizer = torch.optim.Adam(policy.parameters(), lr=settings.learning_rate, eps=1e-5)
    per_rollout = settings.envs * MAX_EPISODE_STEPS
    rollouts = max(1, settings.steps // per_rollout)
    rows = []
    start = time.perf_counter()
    for index in range(rollouts):
        for group in optimizer.param_groups:
            group["lr"] = settings.learning_rate * (1.0 - index / rollouts)
        batch = roll_out(envs, policy, settings.seed if index == 0 else None)
        improve(policy, optimizer, batch, settings)
        seconds = time.perf_counter() - start
        row = ((index + 1) * per_rollout, seconds, float(batch["rewards"].sum(0).mean()))
        rows.append((*row, batch["success"]))
        if (index + 1) % max(1, rollouts // 20) == 0:
            print(
                f"{rows[-1][0]:>11,} steps  {seconds:6.1f} s  return {rows[-1][2]:7.3f}  "
                f"success {rows[-1][3]:6.1%}", flush=True,
            )  # fmt: skip
    if curve is not None:
        with curve.open("w", newline="", encoding="utf-8") as stream:
            csv.writer(stream).writerows([("steps", "seconds", "return", "success"), *rows])
    result = roll_out(tests, policy, seed=1_000_000, greedy=True)
    envs.close()
    tests.close()
    return policy, result["successes"]


def main() -> None:
    """Read the command line, train, and test without exploration noise."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--task", choices=sorted(RECIPES), default="light_chase")
    parser.add_argument("--curve", type=Path, help="CSV file for the learning curve")
    for field in fields(Settings):
        if field.name not in ("task", "recurrent"):
            kind = type(getattr(RECIPES["light_chase"], field.name))
            parser.add_argument(f"--{field.name.replace('_', '-')}", type=kind)
    options = vars(parser.parse_args())
    curve = options.pop("curve")
    given = {name: value for name, value in options.items() if value is not None}
    settings = replace(RECIPES[options["task"]], **given)
    _, successes = train(settings, curve)
    low, high = wilson_interval(successes, settings.test_episodes)
    print(
        f"Without exploration noise: {successes} of {settings.test_episodes} episodes succeed "
        f"(95 % interval {low:.1%} to {high:.1%})."
    )


if __name__ == "__main__":
    main()
