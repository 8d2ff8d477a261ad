"""Growth and episodes of many robots, recorded step by step on the batched simulator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from ncrs.control import Controller, StateError
from ncrs.development import grow, read_body
from ncrs.layout import BODY_CHANNEL
from ncrs.nca import NCAPopulation
from ncrs.report.robots import ReportError
from ncrs_envs.batched.run_batch import RunBatch, default_threads
from ncrs_envs.body import BodyGrid
from ncrs_envs.scenario import Scenario
from ncrs_envs.tasks import MAX_EPISODE_STEPS, TaskSettings

NOT_YET = -1


@dataclass(frozen=True)
class Growth:
    """How P robots grew; the first of G + 1 entries is the seed."""

    bodies: NDArray[np.int8]
    """Cell codes read out after each step, ``(P, G + 1, n, n)``."""
    states: NDArray[np.float32]
    """All channels, ``(P, G + 1, n, n, C)``."""


@dataclass(frozen=True)
class Episodes:
    """E episodes of each of P robots, T steps long; the first of T + 1 entries is the start."""

    poses: NDArray[np.float64]
    """Centre x and y in units, and angle in radians; ``(P, E, T + 1, 3)``."""
    balls: NDArray[np.float64]
    """Ball x and y in units, NaN in tasks without one; ``(P, E, T + 1, 2)``."""
    sensors: NDArray[np.float32]
    """Value in each sensor cell, else 0; ``(P, E, T + 1, n, n)``."""
    gas: NDArray[np.float32]
    """Gas in wheel cells, -1 to 1, that led to this entry; ``(P, E, T + 1, n, n)``, 0 at first."""
    rewards: NDArray[np.float64]
    """Of the step that led to this entry; ``(P, E, T + 1)``, 0 at first."""
    success_steps: NDArray[np.int64]
    """The step at which the episode succeeded, or -1; ``(P, E)``."""
    control_states: NDArray[np.float32]
    """All channels after the last step, ``(P, E, n, n, C)``."""

    @property
    def fitness(self) -> NDArray[np.float64]:
        """Mean reward over the steps, ``(P, E)``."""
        return np.asarray(self.rewards[..., 1:].mean(axis=-1))


def record_growth(population: NCAPopulation, grid_size: int) -> Growth:
    """Grow every robot and keep each step."""
    _, grown = grow(population, grid_size, history=True)
    seed = np.zeros_like(grown[:, :1])
    seed[..., grid_size // 2, grid_size // 2, BODY_CHANNEL] = 1.0
    states = np.concatenate([seed, grown], axis=1)
    bodies = read_body(torch.from_numpy(states).movedim(-1, -3), population.layout)
    return Growth(bodies, states)


def record_episodes(
    population: NCAPopulation,
    bodies: BodyGrid,
    scenarios: Sequence[Scenario],
    settings: TaskSettings,
    steps: int = MAX_EPISODE_STEPS,
) -> Episodes:
    """Drive every robot through the same scenarios.

    Args:
        population: P automata.
        bodies: valid cell codes, ``(P, n, n)``.
        scenarios: E placements that fit the task.
        settings: the task.
        steps: length T of an episode.

    Raises:
        ReportError: a robot's state is no longer finite.
    """
    shape = (len(bodies), len(scenarios))
    runs, n = shape[0] * shape[1], settings.grid_size
    each = np.repeat(bodies, shape[1], axis=0)
    batch = RunBatch(settings, runs, default_threads())
    batch.set_bodies(np.arange(runs), each)
    batch.scenarios.put(range(runs), list(scenarios) * shape[0])
    batch.start(np.arange(runs))
    controller = Controller(population, each.reshape(*shape, n, n))
    poses = np.empty((steps + 1, runs, 3))
    balls = np.full((steps + 1, runs, 2), np.nan)
    sensors = np.empty((steps + 1, runs, n * n), dtype=np.float32)
    gas = np.zeros_like(sensors)
    rewards = np.zeros((steps + 1, runs))
    success = np.full(runs, NOT_YET)
    for step in range(steps + 1):
        if step > 0:
            actions = _act(controller, sensors[step - 1].reshape(*shape, n, n))
            gas[step] = np.clip(actions.reshape(runs, n * n), -1.0, 1.0)
            rewards[step] = batch.step(gas[step], np.ones(runs, dtype=np.bool_))
            success[batch.success & (success == NOT_YET)] = step
        poses[step] = batch.poses
        sensors[step] = batch.observations
        if settings.task.has_ball:
            balls[step] = [batch.ball(run) for run in range(runs)]
    batch.close()
    return Episodes(
        poses=_by_robot(poses, shape),
        balls=_by_robot(balls, shape),
        sensors=_by_robot(sensors, shape).reshape(*shape, steps + 1, n, n),
        gas=_by_robot(gas, shape).reshape(*shape, steps + 1, n, n),
        rewards=_by_robot(rewards, shape),
        success_steps=success.reshape(shape),
        control_states=controller.states,
    )


def _act(controller: Controller, observations: NDArray[np.float32]) -> NDArray[np.float32]:
    try:
        return controller.act(observations)
    except StateError as error:
        raise ReportError(f"An episode cannot be recorded. {error}") from error


def _by_robot(values: NDArray[np.floating], shape: tuple[int, int]) -> NDArray[np.floating]:
    """From ``(T + 1, P * E, ...)`` to ``(P, E, T + 1, ...)``."""
    return np.moveaxis(values, 0, 1).reshape(*shape, values.shape[0], *values.shape[2:])
