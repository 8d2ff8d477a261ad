"""Helpers for the tests of the batched simulator: one run at a time, on its kernels."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ncrs_envs.batched import layout
from ncrs_envs.batched.dynamics import grid_center
from ncrs_envs.batched.layout import STATE_SIZE, STATE_SUCCESS, STATE_TOUCHED
from ncrs_envs.batched.manifolds import scratch_size
from ncrs_envs.batched.records import robot_arrays, scenario_arrays, settings_array
from ncrs_envs.batched.simulate import reset_run, step_run
from ncrs_envs.body import cell_centers, parse_body
from ncrs_envs.episode import Episode, Robot
from ncrs_envs.scenario import Scenario
from ncrs_envs.tasks import MAX_EPISODE_STEPS, TaskSettings


class BatchedRun:
    """One robot in one scenario, with the face of an ``Episode``."""

    def __init__(
        self, task: str, body: Any, scenario: Scenario, score: str = "exponential"
    ) -> None:
        self.body = parse_body(body)
        n = self.body.shape[0]
        self.settings = settings_array(TaskSettings(task, n, score))
        robots, cells = robot_arrays(self.body[None])
        self.robot, self.cells = robots[0], cells[0]
        self.scenario = scenario_arrays([scenario], n)[0]
        self.state = np.zeros(STATE_SIZE)
        self.observation = np.zeros(n * n, dtype=np.float32)
        self.scratch = np.full(scratch_size(n), np.nan)
        reset_run(
            self.settings, self.robot, self.cells, self.scenario, self.state, self.observation
        )

    def step(self, action: NDArray[Any]) -> float:
        return step_run(
            self.settings,
            self.robot,
            self.cells,
            self.scenario,
            self.state,
            self.scratch,
            np.ascontiguousarray(action, dtype=np.float32).reshape(-1),
            self.observation,
        )

    @property
    def center(self) -> tuple[float, float]:
        return grid_center(self.robot, self.state)

    @property
    def touching(self) -> bool:
        return bool(self.state[STATE_TOUCHED])

    @property
    def success(self) -> bool:
        return bool(self.state[STATE_SUCCESS])


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
def batched_run() -> type[BatchedRun]:
    return BatchedRun


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
        batched = BatchedRun(task, body, scenario)
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
def kinetic_energy() -> Callable[[BatchedRun], float]:
    """Energy of a robot's motion."""

    def energy(run: BatchedRun) -> float:
        v_x, v_y, omega = run.state[layout.STATE_VX : layout.STATE_OMEGA + 1]
        mass = 1.0 / run.robot[layout.ROBOT_INVERSE_MASS]
        inertia = 1.0 / run.robot[layout.ROBOT_INVERSE_INERTIA]
        return float(0.5 * (mass * (v_x**2 + v_y**2) + inertia * omega**2))

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
