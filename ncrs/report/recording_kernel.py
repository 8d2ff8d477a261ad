"""The batched engine's rollout, with every step written down.

The same parts in the same order as ``ncrs.engines.rollout_kernels``, so that what is recorded is
what a run evaluated.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import FIRST_PART_CHANNEL, STEPS_PER_ACTION
from ncrs.engines.nca_kernels import (
    CHANGING_CHANNELS,
    CONTROL_LANES,
    RUN_TILE,
    IntArray,
    Network,
    control_constants,
    control_step,
    link_cells,
    network_of,
)
from ncrs.engines.rollout_kernels import Workspace, cell_numbers, read_wheels, write_sensors
from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.dynamics import grid_center
from ncrs_envs.batched.layout import (
    STATE_ANGLE,
    STATE_BALL_X,
    STATE_BALL_Y,
    STATE_SIZE,
    STATE_SUCCESS,
)
from ncrs_envs.batched.robot import prepare_robot
from ncrs_envs.batched.simulate import reset_run, step_run

NOT_YET = -1


class Tapes(NamedTuple):
    """What is written down of P robots in E episodes; the first of T + 1 entries is the start."""

    poses: NDArray[np.float64]
    """Centre x, y and angle, ``(P, E, T + 1, 3)``."""
    balls: NDArray[np.float64]
    """``(P, E, T + 1, 2)``; zeros in tasks without a ball."""
    sensors: NDArray[np.float32]
    """``(P, E, T + 1, n * n)``."""
    gas: NDArray[np.float32]
    """What led to each entry, not clipped, ``(P, E, T + 1, n * n)``."""
    rewards: NDArray[np.float64]
    """``(P, E, T + 1)``."""
    success_steps: IntArray
    """The step of the first success, or -1; ``(P, E)``."""
    changing: NDArray[np.float32]
    """Hidden and input/output channels after the last step, ``(P, E, n * n, 7)``."""
    finite: NDArray[np.bool_]
    """Whether each robot's gas stayed finite, ``(P,)``."""


def make_tapes(robots: int, episodes: int, steps: int, places: int) -> Tapes:
    """Empty tapes for grids of ``places`` cells."""
    shape = (robots, episodes, steps + 1)
    return Tapes(
        poses=np.zeros((*shape, 3)),
        balls=np.zeros((*shape, 2)),
        sensors=np.zeros((*shape, places), dtype=np.float32),
        gas=np.zeros((*shape, places), dtype=np.float32),
        rewards=np.zeros(shape),
        success_steps=np.full(shape[:2], NOT_YET, dtype=np.int64),
        changing=np.zeros((*shape[:2], places, CHANGING_CHANNELS), dtype=np.float32),
        finite=np.ones(robots, dtype=np.bool_),
    )


@kernel
def record_population(
    networks: Network,
    part_codes: NDArray[np.int8],
    settings: NDArray[np.float64],
    scenarios: NDArray[np.float64],
    workspace: Workspace,
    genomes: IntArray,
    bodies: NDArray[np.int8],
    tapes: Tapes,
) -> None:
    """Record the episodes of some robots.

    Args:
        networks: weights for control, shape ``(P, ...)``.
        part_codes: cell code of each part channel.
        settings: from ``records.settings_array``.
        scenarios: from ``records.scenario_arrays``, ``(E, ...)``, for all robots.
        workspace: this call's own.
        genomes: which robots to record.
        bodies: valid cell codes, ``(P, n, n)``.
        tapes: output.
    """
    for genome in genomes:
        network = network_of(networks, genome)
        tapes.finite[genome] = _record(
            network, part_codes, settings, scenarios, workspace, bodies[genome], genome, tapes
        )


@kernel
def _record(
    network: Network,
    part_codes: NDArray[np.int8],
    settings: NDArray[np.float64],
    scenarios: NDArray[np.float64],
    workspace: Workspace,
    body: NDArray[np.int8],
    genome: int,
    tapes: Tapes,
) -> bool:
    """All episodes of one robot in step; returns whether its gas stayed finite."""
    n = body.shape[0]
    runs = scenarios.shape[0]
    robot, cells = workspace.robot, workspace.cells
    prepare_robot(body, robot, cells)
    physics = np.zeros((runs, STATE_SIZE))
    observations = np.zeros((runs, n * n), dtype=np.float32)
    for run in range(runs):
        reset_run(settings, robot, cells, scenarios[run], physics[run], observations[run])
        _write_down(robot, physics[run], observations[run], genome, run, 0, tapes)

    fixed = FIRST_PART_CHANNEL + part_codes.shape[0]
    graph = link_cells(body, fixed + CHANGING_CHANNELS, fixed)
    constants = control_constants(network, part_codes, body)
    numbers = cell_numbers(body)
    tiled_runs = -(-runs // RUN_TILE) * RUN_TILE
    states = np.zeros((graph.start.shape[0] - 1) * tiled_runs * CONTROL_LANES, dtype=np.float32)
    updated = np.zeros_like(states)
    for step in range(1, tapes.rewards.shape[2]):
        for _ in range(STEPS_PER_ACTION):
            write_sensors(cells, n, numbers, observations, tiled_runs, states)
            control_step(network, constants, graph, tiled_runs, states, updated)
            states, updated = updated, states
        for run in range(runs):
            gas = tapes.gas[genome, run, step]
            if not read_wheels(cells, numbers, states, tiled_runs, run, gas):
                return False
            tapes.rewards[genome, run, step] = step_run(
                settings, robot, cells, scenarios[run], physics[run],
                workspace.scratch, gas, observations[run],
            )  # fmt: skip
            _write_down(robot, physics[run], observations[run], genome, run, step, tapes)
    for place in range(n * n):
        if numbers[place] < 0:
            continue
        for run in range(runs):
            first = (numbers[place] * tiled_runs + run) * CONTROL_LANES
            tapes.changing[genome, run, place] = states[first : first + CHANGING_CHANNELS]
    return True


@kernel
def _write_down(
    robot: NDArray[np.float64],
    state: NDArray[np.float64],
    observation: NDArray[np.float32],
    genome: int,
    run: int,
    step: int,
    tapes: Tapes,
) -> None:
    """One entry: poses, sensor values, success."""
    pose = tapes.poses[genome, run, step]
    pose[0], pose[1] = grid_center(robot, state)
    pose[2] = state[STATE_ANGLE]
    tapes.balls[genome, run, step, 0] = state[STATE_BALL_X]
    tapes.balls[genome, run, step, 1] = state[STATE_BALL_Y]
    tapes.sensors[genome, run, step] = observation
    if state[STATE_SUCCESS] != 0.0 and tapes.success_steps[genome, run] == NOT_YET:
        tapes.success_steps[genome, run] = step
