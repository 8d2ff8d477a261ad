"""Many episodes of one task side by side, each with its own robot and scenario, on threads."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.dtypes import Record, assign, column, records
from ncrs_envs.batched.dynamics import grid_center
from ncrs_envs.batched.layout import Robot, Sensor, State, World, Worlds, make_robots, make_scratch
from ncrs_envs.batched.perturbations import exchange_robot, sense_anew
from ncrs_envs.batched.records import robot_records, settings_record
from ncrs_envs.batched.scenario_table import Indices, ScenarioTable
from ncrs_envs.batched.sensing import distances
from ncrs_envs.batched.simulate import reset_episode, step_episode, world_at
from ncrs_envs.body import BodyGrid
from ncrs_envs.cores import available_cores
from ncrs_envs.rendering import Scene
from ncrs_envs.scenario import Point, wall_quads
from ncrs_envs.tasks import TaskSettings, playfield

_MIN_CHUNK = 64
"""Minimum number of episodes per thread; fewer are not worth handing over."""


class Reading(Record):
    """Pose of the grid's centre, and distances, in one episode."""

    x: float
    y: float
    angle: float
    to_goal: float
    to_target: float


class _Episodes(NamedTuple):
    """Arrays that steps change; their first axis is the episodes."""

    states: NDArray[State]
    observations: NDArray[np.float32]
    readings: NDArray[Reading]


class _Step(NamedTuple):
    """Inputs of one step of all episodes, and its rewards as output."""

    actions: NDArray[np.float32]
    is_running: NDArray[np.bool_]
    rewards: NDArray[np.float64]


@kernel
def _start_episodes(worlds: Worlds, episodes: _Episodes, chosen: Indices) -> None:
    for episode in chosen:
        world = world_at(worlds, episode, episode)
        reset_episode(world, episodes.states[episode], episodes.observations[episode])
        _read(world, episodes.states[episode], episodes.readings[episode])


@kernel
def _exchange_robots(
    worlds: Worlds,
    episodes: _Episodes,
    chosen: Indices,
    robots: NDArray[Robot],
    sensors: NDArray[Sensor],
) -> None:
    """Let episodes go on with their present robots in place of those before, which are given."""
    for i in range(len(chosen)):
        episode = chosen[i]
        state: State = episodes.states[episode]
        exchange_robot(robots[i], worlds.robots.robots[episode], state)
        world = world_at(worlds, episode, episode)
        before = sensors[i, : robots[i].sensor_count]
        sense_anew(before, world, state, episodes.observations[episode])
        _read(world, state, episodes.readings[episode])


@kernel
def _step_episodes(worlds: Worlds, episodes: _Episodes, step: _Step, first: int, last: int) -> None:
    for episode in range(first, last):
        if not step.is_running[episode]:
            step.rewards[episode] = 0.0
            continue
        world = world_at(worlds, episode, episode)
        state: State = episodes.states[episode]
        step.rewards[episode] = step_episode(
            world, state, step.actions[episode], episodes.observations[episode]
        )
        _read(world, state, episodes.readings[episode])


@kernel
def _read(world: World, state: State, reading: Reading) -> None:
    reading.x, reading.y = grid_center(world.robot, state)
    reading.angle = state.angle
    reading.to_goal, reading.to_target = distances(world, state)


class EpisodeBatch:
    """Robots, scenarios and states of ``count`` episodes.

    Args:
        settings: The task and its settings.
        count: Number of episodes.
        threads: Maximum number of threads; None for one per core that this process may use.
            Results do not depend on it.

    Attributes:
        scenarios: Scenarios of the episodes.
        observations: Sensor values after the last step, float32 ``(count, n * n)``.
    """

    def __init__(self, settings: TaskSettings, count: int, threads: int | None) -> None:
        n = settings.grid_size
        self.count = count
        self._given, self._task = settings, settings.task
        self._settings = settings_record(settings)
        self._robots = make_robots(count, n)
        self.scenarios = ScenarioTable(settings.task, count, n)
        self.observations = np.zeros((count, n * n), dtype=np.float32)
        self._episodes = _Episodes(
            records(State, count), self.observations, records(Reading, count)
        )
        threads = available_cores() if threads is None else threads
        chunks = max(1, min(threads, count // _MIN_CHUNK))
        self._bounds = np.linspace(0, count, chunks + 1).astype(int).tolist()
        self._scratch = [make_scratch(n) for _ in range(chunks)]
        self._pool: ThreadPoolExecutor | None = None
        self._pool_process = 0

    def _worlds(self, chunk: int) -> Worlds:
        return Worlds(self._settings, self._robots, self.scenarios.records, self._scratch[chunk])

    def set_bodies(self, episodes: Indices, bodies: NDArray[np.int8]) -> None:
        """Set the robots of episodes.

        Args:
            episodes: Indices of the episodes.
            bodies: Valid cell codes, shape ``(len(episodes), n, n)``, or ``(1, n, n)`` for the
                same body in all of them.
        """
        for array, chosen in zip(self._robots, robot_records(bodies), strict=True):
            assign(array, episodes, chosen)

    def exchange_bodies(self, episodes: Indices, bodies: NDArray[np.int8]) -> None:
        """Let running episodes go on with other bodies; arguments as in ``set_bodies``."""
        before = self._robots.robots[episodes].copy(), self._robots.sensors[episodes].copy()
        self.set_bodies(episodes, bodies)
        _exchange_robots(self._worlds(0), self._episodes, episodes, *before)

    def start(self, episodes: Indices) -> None:
        """Start new episodes in the scenarios that the table holds for them."""
        _start_episodes(self._worlds(0), self._episodes, episodes)

    def step(
        self, actions: NDArray[np.float32], is_running: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        """Advance episodes by one step.

        Args:
            actions: Finite gas per cell, shape ``(count, n * n)``.
            is_running: Mask of the episodes to advance, shape ``(count,)``.

        Returns:
            Rewards, shape ``(count,)``; 0 for episodes that are not advanced.
        """
        step = _Step(actions, is_running, np.empty(self.count))

        def work(chunk: int) -> None:
            first, last = self._bounds[chunk], self._bounds[chunk + 1]
            _step_episodes(self._worlds(chunk), self._episodes, step, first, last)

        self._spread(work)
        return step.rewards

    def _spread(self, work: Callable[[int], None]) -> None:
        """Call ``work`` for each chunk of the episodes, the first one on this thread."""
        others = range(1, len(self._bounds) - 1)
        futures = [self._threads().submit(work, chunk) for chunk in others]
        work(0)
        for future in futures:
            future.result()

    def _threads(self) -> ThreadPoolExecutor:
        """Return the threads, started on first use; a forked process has none of its parent's."""
        if self._pool is None or self._pool_process != os.getpid():
            self._pool = ThreadPoolExecutor(len(self._bounds) - 2, "ncrs-envs")
            self._pool_process = os.getpid()
        return self._pool

    def __getstate__(self) -> dict[str, Any]:
        """Return what a pickle or a copy holds: all but the threads."""
        return {**self.__dict__, "_pool": None}

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None and self._pool_process == os.getpid():
            self._pool.shutdown()
        self._pool = None

    @property
    def poses(self) -> NDArray[np.float64]:
        """Poses of the grids' centres: x, y, angle in radians, shape ``(count, 3)``, a copy."""
        readings = self._episodes.readings
        return np.stack([column(readings, name) for name in ("x", "y", "angle")], axis=1)

    @property
    def success(self) -> NDArray[np.bool_]:
        """True for episodes that have succeeded, shape ``(count,)``, a copy."""
        return column(self._episodes.states, "success").copy()

    def infos(self) -> dict[str, NDArray[Any]]:
        """Return the entries of the environments' infos that steps change, as new arrays."""
        infos: dict[str, NDArray[Any]] = {"pose": self.poses, "success": self.success}
        to_goal = column(self._episodes.readings, "to_goal").copy()
        if self._task.has_ball:
            to_target = column(self._episodes.readings, "to_target").copy()
            infos |= {"distance_to_ball": to_goal, "ball_to_target": to_target}
        else:
            infos["distance"] = to_goal
        if self._task.has_walls:
            infos["crossed"] = column(self._episodes.states, "crossed").copy()
        return infos

    def scene(
        self,
        episode: int,
        body: BodyGrid,
        action: NDArray[np.float32],
        path: Sequence[Point],
    ) -> Scene:
        """Describe an episode's scene, for drawing.

        Args:
            episode: Index of an episode that has been started.
            body: Body of its robot, shape ``(n, n)``.
            action: Gas per cell in the last step, shape ``(n, n)``.
            path: Robot centres so far, oldest first; empty if they are not known.
        """
        scenario = self.scenarios[episode]
        assert scenario is not None
        state: State = self._episodes.states[episode]
        x, y, angle = self.poses[episode].tolist()
        return Scene(
            extent=playfield(self._given.grid_size),
            body=body,
            pose=(x, y, angle),
            sensor_values=self.observations[episode].reshape(body.shape).copy(),
            action=action,
            light=scenario.light,
            ball=(float(state.ball_x), float(state.ball_y)) if self._task.has_ball else None,
            target=scenario.target,
            wall_quads=wall_quads(scenario, self._given.grid_size),
            path=np.array(path or [(x, y)]),
            success=bool(state.success),
            success_radius=self._given.radius,
        )
