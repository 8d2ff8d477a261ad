"""Helpers for the tests of the batched simulator: one episode at a time, on its kernels."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ncrs_envs.batched.dtypes import records
from ncrs_envs.batched.dynamics import grid_center
from ncrs_envs.batched.layout import State
from ncrs_envs.batched.records import single_world
from ncrs_envs.batched.simulate import reset_episode, step_episode
from ncrs_envs.body import cell_centers, parse_body
from ncrs_envs.episode import Episode, Robot
from ncrs_envs.scenario import Scenario
from ncrs_envs.tasks import MAX_EPISODE_STEPS, TaskSettings


class BatchedEpisode:
    """One robot in one scenario, with the face of an ``Episode``."""

    def __init__(
        self, task: str, body: Any, scenario: Scenario, score: str = "exponential"
    ) -> None:
        self.body = parse_body(body)
        n = self.body.shape[0]
        self.world = single_world(TaskSettings(task, n, score), self.body, scenario)
        self.spoil(np.nan, -1)
        self.state = records(State, 1)[0]
        self.observation = np.zeros(n * n, dtype=np.float32)
        reset_episode(self.world, self.state, self.observation)

    @property
    def robot(self) -> Any:
        return self.world.robot

    def spoil(self, number: float, integer: int) -> None:
        """Write into all of the room that the solver has."""
        for room in (self.world.contacts, self.world.corners):
            for name in room.dtype.names or ():
                room[name] = number if room[name].dtype.kind == "f" else integer

    def step(self, action: NDArray[Any]) -> float:
        flat = np.ascontiguousarray(action, dtype=np.float32).reshape(-1)
        return step_episode(self.world, self.state, flat, self.observation)

    @property
    def center(self) -> tuple[float, float]:
        return grid_center(self.world.robot, self.state)

    @property
    def touching(self) -> bool:
        return bool(self.state.touched)

    @property
    def success(self) -> bool:
        return bool(self.state.success)


@dataclass
class Comparison:
    """One episode on both simulators, with the same actions."""

    box2d_fitness: float
    batched_fitness: float
    box2d_success: bool
    batched_success: bool
    touched: bool
    apart: float
    """Distance of the robots' centres at the end."""
    largest_sensor_gap: float


def steer(episode: Episode, noise: NDArray[np.float64]) -> NDArray[np.float32]:
    """Gas that turns the robot to the light or ball and drives on."""
    x, y, angle = episode.pose
    goal = episode.ball or episode.scenario.light
    error = math.atan2(x - goal[0], goal[1] - y) - angle
    error = math.atan2(math.sin(error), math.cos(error))
    side = np.sign(cell_centers(episode.settings.grid_size)[..., 0])
    return np.clip(math.cos(error) + error * side + noise, -1.0, 1.0).astype(np.float32)


@pytest.fixture
def batched_episode() -> type[BatchedEpisode]:
    return BatchedEpisode


@pytest.fixture
def compare() -> Callable[..., Comparison]:
    """Runs one episode on both simulators, with given actions or steering at the light or ball."""

    def run(
        task: str,
        body: NDArray[np.int8],
        scenario: Scenario,
        rng: np.random.Generator,
        actions: NDArray[np.float32] | None = None,
    ) -> Comparison:
        n = body.shape[0]
        episode = Episode(TaskSettings(task, n), Robot(body), scenario)
        batched = BatchedEpisode(task, body, scenario)
        rewards, touched, gap = [], False, 0.0
        noise = np.repeat(rng.normal(0.0, 0.3, (MAX_EPISODE_STEPS // 10, n, n)), 10, axis=0)
        for step in range(MAX_EPISODE_STEPS):
            action = steer(episode, noise[step]) if actions is None else actions[step]
            rewards.append((episode.step(action), batched.step(action)))
            touched = touched or episode.world.touching
            seen = np.abs(batched.observation.reshape(n, n) - episode.observation).max()
            gap = max(gap, float(seen))
        box2d_fitness, batched_fitness = np.mean(rewards, axis=0)
        return Comparison(
            box2d_fitness,
            batched_fitness,
            episode.success,
            batched.success,
            touched,
            math.dist(episode.pose[:2], batched.center),
            gap,
        )

    return run


@pytest.fixture
def kinetic_energy() -> Callable[[BatchedEpisode], float]:
    """Energy of a robot's motion."""

    def energy(episode: BatchedEpisode) -> float:
        state, robot = episode.state, episode.robot
        mass, inertia = 1.0 / robot.inverse_mass, 1.0 / robot.inverse_inertia
        return float(0.5 * (mass * (state.vx**2 + state.vy**2) + inertia * state.omega**2))

    return energy


@pytest.fixture
def drifting_bodies(rng: np.random.Generator) -> Iterator[NDArray[np.int8]]:
    """Bodies without wheels, so that nothing but contacts changes their velocity."""

    def draw() -> Iterator[NDArray[np.int8]]:
        while True:
            n = int(rng.choice([3, 5, 9]))
            body = (rng.random((n, n)) < rng.uniform(0.2, 1.0)).astype(np.int8)
            body[n // 2, n // 2] = 2
            yield body

    return draw()
