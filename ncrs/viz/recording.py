"""A robot's life as data: its growth step by step, and episodes as scenes with NCA states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import gymnasium
import numpy as np
import torch
from numpy.typing import NDArray

from ncrs.automaton.control import Controller
from ncrs.automaton.growth import grow, read_body, seed_state
from ncrs.automaton.nca import NCA
from ncrs.automaton.threads import one_torch_thread
from ncrs_envs.body import BodyGrid
from ncrs_envs.rendering import Scene
from ncrs_envs.scenario import Scenario, sample_scenarios
from ncrs_envs.tasks import TaskSettings


class Grown(Protocol):
    """What a recording needs: a ``Champion`` and an ``Elite`` have it."""

    @property
    def nca(self) -> NCA:
        """The automaton, genome set."""

    @property
    def body(self) -> NDArray[np.int8]:
        """Cell codes, ``(n, n)``."""

    @property
    def task(self) -> TaskSettings:
        """The task with its settings."""


@dataclass(frozen=True, eq=False)
class Growth:
    """Growth from the seed cell, T steps."""

    states: NDArray[np.float32]
    """NCA states, the first of the seed, ``(T + 1, n, n, C)``."""
    bodies: NDArray[np.int8]
    """What each state would be read out as, ``(T + 1, n, n)``."""


@dataclass(frozen=True, eq=False)
class Recording:
    """One episode on Box2D, T steps."""

    scenes: Sequence[Scene]
    """What there was to see: the start, then after every step; T + 1 of them."""
    states: NDArray[np.float32]
    """NCA states at the same times, ``(T + 1, n, n, C)``."""
    rewards: NDArray[np.float64]
    """Reward of every step, ``(T,)``."""
    scenario: Scenario

    @property
    def success(self) -> bool:
        """Whether the task was ever solved."""
        return self.scenes[-1].success


def record_growth(robot: Grown) -> Growth:
    """Grow a robot again and keep every state."""
    nca, grid_size = robot.nca, robot.task.grid_size
    with one_torch_thread():
        _, grown = grow(nca, grid_size, history=True)
    states = np.concatenate([seed_state(nca.channels, grid_size).movedim(0, -1)[None], grown])
    channels_first = torch.from_numpy(states).movedim(-1, -3)
    return Growth(states, read_body(channels_first, nca.layout))


def make_env(task: TaskSettings, body: BodyGrid) -> gymnasium.Env[Any, Any]:
    """The Box2D environment of a task with its settings, for one body.

    Raises:
        BodyError: a body that the task cannot use.
    """
    settings = task
    return gymnasium.make(
        f"ncrs_envs:{settings.task.env_id}",
        body=body.tolist(),
        grid_size=settings.grid_size,
        distance_score=settings.distance_score,
        success_radius=settings.radius,
    )


def record_episode(robot: Grown, scenario: Scenario) -> Recording:
    """Drive a robot through one episode on Box2D.

    Raises:
        BodyError: a body that the task cannot use.
        ScenarioError: a scenario that does not fit the task.
    """
    env = make_env(robot.task, robot.body)
    controller = Controller(robot.nca, robot.body)
    observation, _ = env.reset(options={"scenario": scenario})
    unwrapped: Any = env.unwrapped
    scenes: list[Scene] = [unwrapped.scene]
    states = [controller.states]
    rewards = []
    truncated = False
    with one_torch_thread():
        while not truncated:
            observation, reward, _, truncated, _ = env.step(controller.act(observation))
            scenes.append(unwrapped.scene)
            states.append(controller.states)
            rewards.append(float(reward))
    env.close()
    return Recording(scenes, np.stack(states), np.array(rewards), scenario)


def record_episodes(robot: Grown, episodes: int, seed: int) -> list[Recording]:
    """Drive a robot through ``episodes`` scenarios drawn from ``seed``; regions take turns.

    Raises:
        BodyError: a body that the task cannot use.
        ScenarioError: ``episodes`` is not a positive integer.
    """
    settings = robot.task
    scenarios = sample_scenarios(settings.task, seed, episodes, settings.grid_size)
    return [record_episode(robot, scenario) for scenario in scenarios]
