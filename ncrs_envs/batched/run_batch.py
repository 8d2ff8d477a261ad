"""Many runs of one task side by side, each with its own robot and scenario, on several threads."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.dynamics import grid_center
from ncrs_envs.batched.layout import (
    STATE_ANGLE,
    STATE_BALL_X,
    STATE_BALL_Y,
    STATE_CROSSED,
    STATE_SIZE,
    STATE_SUCCESS,
    cells_size,
    robot_size,
)
from ncrs_envs.batched.manifolds import scratch_size
from ncrs_envs.batched.records import robot_arrays, settings_array
from ncrs_envs.batched.scenario_table import Indices, ScenarioTable
from ncrs_envs.batched.sensing import distances
from ncrs_envs.batched.simulate import reset_run, step_run
from ncrs_envs.tasks import TaskSettings

_LEAST_SHARE = 64
"""Runs that are worth handing to another thread."""


@kernel
def _start_runs(
    settings: NDArray[np.float64],
    robots: NDArray[np.float64],
    cells: NDArray[np.int32],
    scenarios: NDArray[np.float64],
    states: NDArray[np.float64],
    observations: NDArray[np.float32],
    readings: NDArray[np.float64],
    runs: Indices,
) -> None:
    for run in runs:
        reset_run(settings, robots[run], cells[run], scenarios[run], states[run], observations[run])
        _read(settings, robots[run], scenarios[run], states[run], readings[run])


@kernel
def _step_runs(
    settings: NDArray[np.float64],
    robots: NDArray[np.float64],
    cells: NDArray[np.int32],
    scenarios: NDArray[np.float64],
    states: NDArray[np.float64],
    scratch: NDArray[np.float64],
    actions: NDArray[np.float32],
    observations: NDArray[np.float32],
    readings: NDArray[np.float64],
    rewards: NDArray[np.float64],
    is_running: NDArray[np.bool_],
    first: int,
    last: int,
) -> None:
    for run in range(first, last):
        if not is_running[run]:
            rewards[run] = 0.0
            continue
        rewards[run] = step_run(
            settings,
            robots[run],
            cells[run],
            scenarios[run],
            states[run],
            scratch,
            actions[run],
            observations[run],
        )
        _read(settings, robots[run], scenarios[run], states[run], readings[run])


@kernel
def _read(
    settings: NDArray[np.float64],
    robot: NDArray[np.float64],
    scenario: NDArray[np.float64],
    state: NDArray[np.float64],
    reading: NDArray[np.float64],
) -> None:
    """Pose and distances of one run."""
    reading[0], reading[1] = grid_center(robot, state)
    reading[2] = state[STATE_ANGLE]
    reading[3], reading[4] = distances(settings, robot, scenario, state)


def default_threads() -> int:
    """Number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class RunBatch:
    """Robots, scenarios and states of ``count`` runs.

    Args:
        settings: the task and its settings.
        count: number of runs.
        threads: largest number of threads to step them on; results do not depend on it.

    Attributes:
        scenarios: the scenario of each run.
        observations: sensor values after the last step, float32 ``(count, n * n)``.
    """

    def __init__(self, settings: TaskSettings, count: int, threads: int) -> None:
        n = settings.grid_size
        self.count = count
        self._task = settings.task
        self._settings = settings_array(settings)
        self._robots = np.zeros((count, robot_size(n)))
        self._cells = np.zeros((count, cells_size(n)), dtype=np.int32)
        self.scenarios = ScenarioTable(settings.task, count, n)
        self._states = np.zeros((count, STATE_SIZE))
        self._readings = np.zeros((count, 5))
        self.observations = np.zeros((count, n * n), dtype=np.float32)
        shares = max(1, min(threads, count // _LEAST_SHARE))
        self._bounds = np.linspace(0, count, shares + 1).astype(int).tolist()
        self._scratch = np.zeros((shares, scratch_size(n)))
        self._pool = ThreadPoolExecutor(shares - 1, "ncrs-envs") if shares > 1 else None

    def set_bodies(self, runs: Indices, bodies: NDArray[np.int8]) -> None:
        """Give runs their robots.

        Args:
            runs: which runs.
            bodies: valid cell codes, shape ``(len(runs), n, n)``, or ``(1, n, n)`` for all alike.
        """
        self._robots[runs], self._cells[runs] = robot_arrays(bodies)

    def start(self, runs: Indices) -> None:
        """Begin new episodes in some runs, with the scenarios that the table holds for them."""
        _start_runs(
            self._settings,
            self._robots,
            self._cells,
            self.scenarios.records,
            self._states,
            self.observations,
            self._readings,
            runs,
        )

    def step(
        self, actions: NDArray[np.float32], is_running: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        """Advance runs by one step.

        Args:
            actions: finite gas per cell, shape ``(count, n * n)``.
            is_running: which runs to advance, shape ``(count,)``; the others stay as they are.

        Returns:
            Rewards, shape ``(count,)``, 0 for the others.
        """
        rewards = np.empty(self.count)

        def work(share: int) -> None:
            _step_runs(
                self._settings,
                self._robots,
                self._cells,
                self.scenarios.records,
                self._states,
                self._scratch[share],
                actions,
                self.observations,
                self._readings,
                rewards,
                is_running,
                self._bounds[share],
                self._bounds[share + 1],
            )

        self._spread(work)
        return rewards

    def _spread(self, work: Callable[[int], None]) -> None:
        """Call ``work`` for each share of the runs, the first of them on this thread."""
        others = range(1, len(self._bounds) - 1)
        futures = [] if self._pool is None else [self._pool.submit(work, i) for i in others]
        work(0)
        for future in futures:
            future.result()

    def close(self) -> None:
        """End the threads; the batch cannot be stepped afterwards."""
        if self._pool is not None:
            self._pool.shutdown()

    @property
    def poses(self) -> NDArray[np.float64]:
        """Grid centres and headings: x, y, angle in radians, shape ``(count, 3)``, a copy."""
        return self._readings[:, :3].copy()

    @property
    def success(self) -> NDArray[np.bool_]:
        """Which episodes have succeeded, shape ``(count,)``."""
        return np.asarray(self._states[:, STATE_SUCCESS] != 0.0)

    def infos(self) -> dict[str, NDArray[Any]]:
        """What changes in the single environments' infos, batched; new arrays."""
        infos: dict[str, NDArray[Any]] = {"pose": self.poses, "success": self.success}
        near, far = self._readings[:, 3].copy(), self._readings[:, 4].copy()
        if self._task.has_ball:
            infos |= {"distance_to_ball": near, "ball_to_target": far}
        else:
            infos["distance"] = near
        if self._task.has_walls:
            infos["crossed"] = np.asarray(self._states[:, STATE_CROSSED] != 0.0)
        return infos

    def ball(self, run: int) -> tuple[float, float]:
        """Where a run's ball is."""
        return float(self._states[run, STATE_BALL_X]), float(self._states[run, STATE_BALL_Y])
