"""Environments on a GPU, for ``benchmarks.gpu``: million env steps per second, resets included."""

from __future__ import annotations

import time
from typing import Any

import gymnasium
import torch

from ncrs_envs.cuda.gpu import wait
from ncrs_envs.tasks import MAX_EPISODE_STEPS, PAPER_TASKS

ENVIRONMENTS = 65_536
MIN_STEPS = {"light_chase": 50e6}
"""A goal, which was not measured yet."""
_TURNS = 3


def environments(count: int = ENVIRONMENTS) -> list[dict[str, Any]]:
    """Measure episodes with random actions, of which every one is followed by another."""
    rows = []
    for task in PAPER_TASKS:
        envs: Any = gymnasium.make_vec(
            task.env_id, num_envs=count, device="cuda", autoreset_mode="SameStep"
        )
        envs.reset(seed=0)
        actions = torch.rand((8, *envs.action_space.shape), device=envs.device) * 2.0 - 1.0
        envs.step(actions[0])  # compiles
        seconds = []
        for _ in range(_TURNS):
            wait()
            start = time.perf_counter()
            for step in range(MAX_EPISODE_STEPS):
                envs.step(actions[step % len(actions)])
            wait()
            seconds.append(time.perf_counter() - start)
        envs.close()
        best = min(seconds)
        rows.append(
            {
                "task": task.name,
                "environments": count,
                "step_ms": 1e3 * best / MAX_EPISODE_STEPS,
                "steps_per_s": count * MAX_EPISODE_STEPS / best,
            }
        )
    return rows


def print_environments(rows: list[dict[str, Any]]) -> None:
    """Print a line for each task."""
    for row in rows:
        print(
            f"make_vec {row['task']:12} {row['environments']:7,} environments "
            f"{row['step_ms']:8.3f} ms a step {row['steps_per_s'] / 1e6:8.1f} M steps/s"
        )


def missed_environments(rows: list[dict[str, Any]]) -> list[str]:
    """Return a sentence for each floor that is missed."""
    return [
        f"make_vec of {row['task']}: {row['steps_per_s'] / 1e6:.1f} million steps/s, at least "
        f"{MIN_STEPS[row['task']] / 1e6:.0f} expected"
        for row in rows
        if row["steps_per_s"] < MIN_STEPS.get(row["task"], 0.0)
    ]
