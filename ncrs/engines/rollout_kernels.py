"""Growth of a population, and its fused rollout: NCA, physics and scoring in one compiled loop.

Both kernels work through a list of genomes and write only those genomes' rows, so callers can
spread genomes over threads in any way with the same results. With tapes the rollout also records
every step, which does not change its results.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import FIRST_PART_CHANNEL, STEPS_PER_ACTION
from ncrs.engines.nca_kernels import (
    CHANGING_CHANNELS,
    CONTROL_LANES,
    EPISODE_TILE,
    IO_LANE,
    FloatArray,
    IntArray,
    Network,
    control_constants,
    control_step,
    grow_body,
    link_cells,
    network_of,
)
from ncrs.engines.tapes import Entry, Tapes, record_action, record_poses, record_states
from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.dtypes import records
from ncrs_envs.batched.layout import (
    Robots,
    Scenarios,
    Scratch,
    Sensor,
    Settings,
    State,
    Wheel,
    Worlds,
    make_robots,
    make_scratch,
)
from ncrs_envs.batched.robot import prepare_robot
from ncrs_envs.batched.simulate import reset_episode, step_episode, world_at
from ncrs_envs.body import Cell

_EMPTY = int(Cell.EMPTY)


class Grown(NamedTuple):
    """Bodies of a population."""

    bodies: NDArray[np.int8]
    """Cell codes, ``(P, n, n)``."""
    finite: NDArray[np.bool_]
    """True if all states stayed finite, ``(P,)``; otherwise the body is empty."""


class Rollout(NamedTuple):
    """Inputs of a rollout: P genomes in E episodes each."""

    networks: Network
    """Weights for control, ``(P, ...)``."""
    part_codes: NDArray[np.int8]
    """Cell code of each part channel."""
    bodies: NDArray[np.int8]
    """Cell codes, ``(P, n, n)``."""
    settings: Settings
    scenarios: Scenarios
    """``(P or 1, E)``."""
    steps: int
    """Number of env steps per episode."""


class Outcomes(NamedTuple):
    """Results of P genomes in E episodes; see ``ncrs.engines.base.Evaluation``."""

    episode_fitness: NDArray[np.float64]
    """Mean reward, ``(P, E)``; NaN where the automaton's state turned non-finite."""
    success: NDArray[np.bool_]
    crossed: NDArray[np.bool_]
    closest: NDArray[np.float64]
    """``(P, E, D)``: robot to light, or robot to ball and ball to target."""


class Workspace(NamedTuple):
    """Buffers for the physics of one robot at a time; threads must not share them."""

    robots: Robots
    """One robot's records, or two where bodies are exchanged."""
    scratch: Scratch
    states: NDArray[State]
    """States of all episodes."""


def make_outcomes(population: int, episodes: int, distances: int) -> Outcomes:
    """Return the outcomes of episodes that have not begun."""
    return Outcomes(
        np.zeros((population, episodes)),
        np.zeros((population, episodes), dtype=np.bool_),
        np.zeros((population, episodes), dtype=np.bool_),
        np.full((population, episodes, distances), np.inf),
    )


def make_workspace(grid_size: int, episodes: int, robots: int = 1) -> Workspace:
    """Return a new workspace for bodies of ``grid_size`` in ``episodes`` episodes."""
    return Workspace(
        make_robots(robots, grid_size), make_scratch(grid_size), records(State, episodes)
    )


@kernel
def grow_population(
    networks: Network,
    part_codes: NDArray[np.int8],
    steps: int,
    genomes: IntArray,
    grown: Grown,
) -> None:
    """Grow the bodies of the chosen genomes.

    Args:
        networks: Weights for growth, shape ``(P, ...)``.
        part_codes: Cell code of each part channel.
        steps: Number of growth steps.
        genomes: Indices of the genomes to grow.
        grown: Output.
    """
    for genome in genomes:
        network = network_of(networks, genome)
        grown.finite[genome] = grow_body(network, part_codes, steps, grown.bodies[genome])


@kernel
def roll_out_population(
    rollout: Rollout,
    workspace: Workspace,
    genomes: IntArray,
    outcomes: Outcomes,
    tapes: Tapes | None,
) -> None:
    """Drive the robots of the chosen genomes through their episodes.

    Args:
        rollout: Inputs of the rollout.
        workspace: Workspace of this call alone.
        genomes: Indices of the genomes to roll out, whose bodies are valid.
        outcomes: Output.
        tapes: Output, the record of every step; None for no record.
    """
    for genome in genomes:
        _roll_out_genome(rollout, workspace, genome, outcomes, tapes)


@kernel
def _roll_out_genome(
    rollout: Rollout,
    workspace: Workspace,
    genome: int,
    outcomes: Outcomes,
    tapes: Tapes | None,
) -> None:
    """Drive one genome's robot through its episodes, side by side; arguments as above."""
    body = rollout.bodies[genome]
    network = network_of(rollout.networks, genome)
    fitness = outcomes.episode_fitness[genome]
    states = workspace.states
    places = body.size
    episodes = len(states)
    robots = workspace.robots
    prepare_robot(body, robots.robots[0], robots.wheels[0], robots.sensors[0], robots.exposed[0])
    row = genome % len(rollout.scenarios.scenarios)
    scenarios = Scenarios(rollout.scenarios.scenarios[row], rollout.scenarios.quads[row])
    worlds = Worlds(rollout.settings, robots, scenarios, workspace.scratch)
    observations = np.zeros((episodes, places), dtype=np.float32)
    actions = np.zeros((episodes, places), dtype=np.float32)
    for episode in range(episodes):
        fitness[episode] = 0.0
        world = world_at(worlds, 0, episode)
        reset_episode(world, states[episode], observations[episode])
        if tapes is not None:
            entry = Entry(genome, episode, 0)
            record_poses(tapes, entry, world.robot, states[episode], observations[episode])

    fixed = FIRST_PART_CHANNEL + rollout.part_codes.shape[0]
    graph = link_cells(body, fixed + CHANGING_CHANNELS, fixed)
    constants = control_constants(network, rollout.part_codes, body)
    indices = cell_indices(body)
    tiled = -(-episodes // EPISODE_TILE) * EPISODE_TILE
    current = np.zeros((graph.start.shape[0] - 1, tiled, CONTROL_LANES), dtype=np.float32)
    updated = np.zeros_like(current)
    sensors = robots.sensors[0, : robots.robots[0].sensor_count]
    wheels = robots.wheels[0, : robots.robots[0].wheel_count]
    for step in range(1, rollout.steps + 1):
        for _ in range(STEPS_PER_ACTION):
            write_sensors(sensors, indices, observations, current)
            control_step(network, constants, graph, current, updated)
            current, updated = updated, current
        for episode in range(episodes):
            if not read_wheels(wheels, indices, current, episode, actions[episode]):
                fitness[episode] = np.nan
            if np.isfinite(fitness[episode]):
                world = world_at(worlds, 0, episode)
                reward = step_episode(
                    world, states[episode], actions[episode], observations[episode]
                )
                fitness[episode] += reward
                if tapes is not None:
                    entry = Entry(genome, episode, step)
                    record_action(tapes, entry, actions[episode], reward)
                    record_poses(tapes, entry, world.robot, states[episode], observations[episode])
    if tapes is not None:
        record_states(tapes, genome, indices, current)
    for episode in range(episodes):
        fitness[episode] /= rollout.steps
        if not is_finite(current, episode):
            fitness[episode] = np.nan
        record_progress(outcomes, genome, episode, states[episode])


@kernel
def record_progress(outcomes: Outcomes, genome: int, episode: int, state: State) -> None:
    """Write success, crossing and closest approaches of an episode that is over."""
    outcomes.success[genome, episode] = state.success
    outcomes.crossed[genome, episode] = state.crossed
    closest = outcomes.closest[genome, episode]
    closest[0] = state.closest_goal
    if len(closest) > 1:
        closest[1] = state.closest_target


@kernel
def cell_indices(body: NDArray[np.int8]) -> IntArray:
    """Return each place's index among the occupied cells, or -1; the grid is flat."""
    indices = np.full(body.size, -1, dtype=np.int64)
    cells = 0
    for place in range(body.size):
        if body.flat[place] != _EMPTY:
            indices[place] = cells
            cells += 1
    return indices


@kernel
def write_sensors(
    sensors: NDArray[Sensor], indices: IntArray, observations: FloatArray, states: FloatArray
) -> None:
    """Overwrite the input/output channel of sensor cells with the sensor values."""
    for i in range(len(sensors)):
        place = sensors[i].place
        for episode in range(observations.shape[0]):
            states[indices[place], episode, IO_LANE] = observations[episode, place]


@kernel
def read_wheels(
    wheels: NDArray[Wheel], indices: IntArray, states: FloatArray, episode: int, action: FloatArray
) -> bool:
    """Read the wheels' gas into ``action`` and return True if all of it is finite."""
    finite = True
    for i in range(len(wheels)):
        place = wheels[i].place
        gas = states[indices[place], episode, IO_LANE]
        action[place] = gas
        finite = finite and np.isfinite(gas)
    return finite


@kernel
def is_finite(states: FloatArray, episode: int) -> bool:
    """Return True if an episode's states are finite; a NaN stays in its cell until the end."""
    for cell in range(states.shape[0]):
        for lane in range(CONTROL_LANES):
            if not np.isfinite(states[cell, episode, lane]):
                return False
    return True
