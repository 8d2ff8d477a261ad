"""Growth of a population, and the fused rollout: NCA, physics and scoring in one compiled loop.

Both kernels work through a list of genomes and write only those genomes' rows, so that callers can
spread genomes over threads as they like; no result depends on how.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import FIRST_PART_CHANNEL, STEPS_PER_ACTION
from ncrs.engines.nca_kernels import (
    CHANGING_CHANNELS,
    CONTROL_LANES,
    IO_LANE,
    RUN_TILE,
    FloatArray,
    IntArray,
    Network,
    control_constants,
    control_step,
    grow_body,
    link_cells,
    network_of,
)
from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.layout import (
    CELLS_HEADER,
    CELLS_SENSORS,
    CELLS_WHEELS,
    STATE_CLOSEST,
    STATE_CROSSED,
    STATE_SIZE,
    STATE_SUCCESS,
    cells_size,
    robot_size,
)
from ncrs_envs.batched.manifolds import scratch_size
from ncrs_envs.batched.robot import prepare_robot
from ncrs_envs.batched.simulate import reset_run, step_run
from ncrs_envs.body import Cell

_EMPTY = int(Cell.EMPTY)


class Workspace(NamedTuple):
    """What the physics of one robot at a time needs; see ``ncrs_envs.batched.simulate``."""

    robot: NDArray[np.float64]
    cells: NDArray[np.int32]
    scratch: NDArray[np.float64]


def make_workspace(grid_size: int) -> Workspace:
    """A new workspace for bodies of that grid size; threads must not share one."""
    return Workspace(
        np.zeros(robot_size(grid_size)),
        np.zeros(cells_size(grid_size), dtype=np.int32),
        np.zeros(scratch_size(grid_size)),
    )


@kernel
def grow_population(
    networks: Network,
    part_codes: NDArray[np.int8],
    steps: int,
    genomes: IntArray,
    bodies: NDArray[np.int8],
    finite: NDArray[np.bool_],
) -> None:
    """Grow the bodies of some genomes.

    Args:
        networks: weights for growth, shape ``(P, ...)``.
        part_codes: cell code of each part channel.
        steps: number of growth steps.
        genomes: which genomes to grow.
        bodies: output, shape ``(P, n, n)``.
        finite: output, ``(P,)``: whether all states stayed finite; the body is empty if not.
    """
    for genome in genomes:
        network = network_of(networks, genome)
        finite[genome] = grow_body(network, part_codes, steps, bodies[genome])


@kernel
def roll_out_population(
    networks: Network,
    part_codes: NDArray[np.int8],
    settings: NDArray[np.float64],
    scenarios: NDArray[np.float64],
    steps: int,
    workspace: Workspace,
    genomes: IntArray,
    bodies: NDArray[np.int8],
    episode_fitness: NDArray[np.float64],
    success: NDArray[np.bool_],
    crossed: NDArray[np.bool_],
    closest: NDArray[np.float64],
) -> None:
    """Drive the robots of some genomes through their runs.

    Args:
        networks: weights for control, shape ``(P, ...)``.
        part_codes: cell code of each part channel.
        settings: from ``records.settings_array``.
        scenarios: from ``records.scenario_arrays``, shape ``(P or 1, R, ...)``.
        steps: control steps per run.
        workspace: this call's own.
        genomes: which genomes to roll out.
        bodies: cell codes, ``(P, n, n)``, valid for these genomes.
        episode_fitness: output, ``(P, R)``: mean reward; NaN where the state turned non-finite.
        success: output, ``(P, R)``.
        crossed: output, ``(P, R)``.
        closest: output, ``(P, R, D)``: least distances to the light, or to the ball and of that to
            the target.
    """
    for genome in genomes:
        _roll_out_genome(
            network_of(networks, genome),
            part_codes,
            settings,
            scenarios[genome % scenarios.shape[0]],
            steps,
            workspace,
            bodies[genome],
            episode_fitness[genome],
            success[genome],
            crossed[genome],
            closest[genome],
        )


@kernel
def _roll_out_genome(
    network: Network,
    part_codes: NDArray[np.int8],
    settings: NDArray[np.float64],
    scenarios: NDArray[np.float64],
    steps: int,
    workspace: Workspace,
    body: NDArray[np.int8],
    episode_fitness: NDArray[np.float64],
    success: NDArray[np.bool_],
    crossed: NDArray[np.bool_],
    closest: NDArray[np.float64],
) -> None:
    """All runs of one genome in step; arguments as above, of this genome alone."""
    n = body.shape[0]
    runs = scenarios.shape[0]
    robot, cells = workspace.robot, workspace.cells
    prepare_robot(body, robot, cells)
    physics = np.zeros((runs, STATE_SIZE))
    observations = np.zeros((runs, n * n), dtype=np.float32)
    actions = np.zeros((runs, n * n), dtype=np.float32)
    for run in range(runs):
        episode_fitness[run] = 0.0
        reset_run(settings, robot, cells, scenarios[run], physics[run], observations[run])

    fixed = FIRST_PART_CHANNEL + part_codes.shape[0]
    graph = link_cells(body, fixed + CHANGING_CHANNELS, fixed)
    constants = control_constants(network, part_codes, body)
    numbers = cell_numbers(body)
    tiled_runs = -(-runs // RUN_TILE) * RUN_TILE
    states = np.zeros((graph.start.shape[0] - 1) * tiled_runs * CONTROL_LANES, dtype=np.float32)
    updated = np.zeros_like(states)
    for _ in range(steps):
        for _ in range(STEPS_PER_ACTION):
            write_sensors(cells, n, numbers, observations, tiled_runs, states)
            control_step(network, constants, graph, tiled_runs, states, updated)
            states, updated = updated, states
        for run in range(runs):
            if not read_wheels(cells, numbers, states, tiled_runs, run, actions[run]):
                episode_fitness[run] = np.nan
            if np.isfinite(episode_fitness[run]):
                episode_fitness[run] += step_run(
                    settings, robot, cells, scenarios[run], physics[run],
                    workspace.scratch, actions[run], observations[run],
                )  # fmt: skip
    for run in range(runs):
        episode_fitness[run] /= steps
        success[run] = physics[run, STATE_SUCCESS] != 0.0
        crossed[run] = physics[run, STATE_CROSSED] != 0.0
        for distance in range(closest.shape[1]):
            closest[run, distance] = physics[run, STATE_CLOSEST + distance]
        if not _is_finite(states, tiled_runs, run):
            episode_fitness[run] = np.nan


@kernel
def cell_numbers(body: NDArray[np.int8]) -> IntArray:
    """For each place of the flat grid, the number of its cell among the occupied ones."""
    numbers = np.full(body.size, -1, dtype=np.int64)
    cells = 0
    for place in range(body.size):
        if body.flat[place] != _EMPTY:
            numbers[place] = cells
            cells += 1
    return numbers


@kernel
def write_sensors(
    cells: NDArray[np.int32],
    grid_size: int,
    numbers: IntArray,
    observations: FloatArray,
    tiled_runs: int,
    states: FloatArray,
) -> None:
    """Overwrite the input/output channel of sensor cells with the sensor values."""
    first = CELLS_HEADER + grid_size * grid_size
    for sensor in range(cells[CELLS_SENSORS]):
        place = cells[first + sensor]
        for run in range(observations.shape[0]):
            lane = (numbers[place] * tiled_runs + run) * CONTROL_LANES + IO_LANE
            states[lane] = observations[run, place]


@kernel
def read_wheels(
    cells: NDArray[np.int32],
    numbers: IntArray,
    states: FloatArray,
    tiled_runs: int,
    run: int,
    action: FloatArray,
) -> bool:
    """Read the wheels' gas into ``action``; returns whether all of it is finite."""
    finite = True
    for wheel in range(cells[CELLS_WHEELS]):
        place = cells[CELLS_HEADER + wheel]
        gas = states[(numbers[place] * tiled_runs + run) * CONTROL_LANES + IO_LANE]
        action[place] = gas
        finite = finite and np.isfinite(gas)
    return finite


@kernel
def _is_finite(states: FloatArray, tiled_runs: int, run: int) -> bool:
    """Whether the states of one run are finite; a NaN stays in its cell until the end."""
    stride = tiled_runs * CONTROL_LANES
    for cell in range(states.shape[0] // stride):
        for lane in range(CONTROL_LANES):
            if not np.isfinite(states[cell * stride + run * CONTROL_LANES + lane]):
                return False
    return True
