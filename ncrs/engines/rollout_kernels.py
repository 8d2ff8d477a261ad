"""Growth of a population, and the fused rollout: NCA, physics and scoring in one compiled loop.

Both kernels work through a list of genomes and write only those genomes' rows, so that callers can
spread genomes over threads as they like; no result depends on how. With tapes the rollout also
writes down every step, which changes nothing in what it computes.
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
    """Whether all states stayed finite, ``(P,)``; the body is empty if not."""


class Rollout(NamedTuple):
    """What to roll out: P genomes in E episodes each."""

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
    """Control steps per episode."""


class Outcomes(NamedTuple):
    """What comes of P genomes in E episodes; see ``ncrs.engines.base.Evaluation``."""

    episode_fitness: NDArray[np.float64]
    """Mean reward, ``(P, E)``; NaN where the automaton's state turned non-finite."""
    success: NDArray[np.bool_]
    crossed: NDArray[np.bool_]
    closest: NDArray[np.float64]
    """``(P, E, D)``: to the light, or to the ball and of that to the target."""


class Workspace(NamedTuple):
    """What the physics of one robot at a time needs; threads must not share one."""

    robots: Robots
    """Of one."""
    scratch: Scratch
    states: NDArray[State]
    """Of all its episodes."""


def make_outcomes(population: int, episodes: int, distances: int) -> Outcomes:
    """Outcomes of episodes that have not begun."""
    return Outcomes(
        np.zeros((population, episodes)),
        np.zeros((population, episodes), dtype=np.bool_),
        np.zeros((population, episodes), dtype=np.bool_),
        np.full((population, episodes, distances), np.inf),
    )


def make_workspace(grid_size: int, episodes: int) -> Workspace:
    """A new workspace for bodies of that grid size in so many episodes."""
    return Workspace(make_robots(1, grid_size), make_scratch(grid_size), records(State, episodes))


@kernel
def grow_population(
    networks: Network,
    part_codes: NDArray[np.int8],
    steps: int,
    genomes: IntArray,
    grown: Grown,
) -> None:
    """Grow the bodies of some genomes.

    Args:
        networks: weights for growth, shape ``(P, ...)``.
        part_codes: cell code of each part channel.
        steps: number of growth steps.
        genomes: which genomes to grow.
        grown: output.
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
    """Drive the robots of some genomes through their episodes.

    Args:
        rollout: what to roll out.
        workspace: this call's own.
        genomes: which genomes to roll out; their bodies are valid.
        outcomes: output.
        tapes: output of every step, or None.
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
    """All episodes of one genome in step; arguments as above."""
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
    numbers = cell_numbers(body)
    tiled = -(-episodes // EPISODE_TILE) * EPISODE_TILE
    current = np.zeros((graph.start.shape[0] - 1, tiled, CONTROL_LANES), dtype=np.float32)
    updated = np.zeros_like(current)
    sensors = robots.sensors[0, : robots.robots[0].sensor_count]
    wheels = robots.wheels[0, : robots.robots[0].wheel_count]
    for step in range(1, rollout.steps + 1):
        for _ in range(STEPS_PER_ACTION):
            _write_sensors(sensors, numbers, observations, current)
            control_step(network, constants, graph, current, updated)
            current, updated = updated, current
        for episode in range(episodes):
            if not _read_wheels(wheels, numbers, current, episode, actions[episode]):
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
        record_states(tapes, genome, numbers, current)
    for episode in range(episodes):
        fitness[episode] /= rollout.steps
        if not _is_finite(current, episode):
            fitness[episode] = np.nan
        state: State = states[episode]
        outcomes.success[genome, episode] = state.success
        outcomes.crossed[genome, episode] = state.crossed
        closest = outcomes.closest[genome, episode]
        closest[0] = state.closest_goal
        if len(closest) > 1:
            closest[1] = state.closest_target


@kernel
def cell_numbers(body: NDArray[np.int8]) -> IntArray:
    """For each place of the flat grid, the number of its cell among the occupied ones, or -1."""
    numbers = np.full(body.size, -1, dtype=np.int64)
    cells = 0
    for place in range(body.size):
        if body.flat[place] != _EMPTY:
            numbers[place] = cells
            cells += 1
    return numbers


@kernel
def _write_sensors(
    sensors: NDArray[Sensor], numbers: IntArray, observations: FloatArray, states: FloatArray
) -> None:
    """Overwrite the input/output channel of sensor cells with the sensor values."""
    for i in range(len(sensors)):
        place = sensors[i].place
        for episode in range(observations.shape[0]):
            states[numbers[place], episode, IO_LANE] = observations[episode, place]


@kernel
def _read_wheels(
    wheels: NDArray[Wheel], numbers: IntArray, states: FloatArray, episode: int, action: FloatArray
) -> bool:
    """Read the wheels' gas into ``action``; returns whether all of it is finite."""
    finite = True
    for i in range(len(wheels)):
        place = wheels[i].place
        gas = states[numbers[place], episode, IO_LANE]
        action[place] = gas
        finite = finite and np.isfinite(gas)
    return finite


@kernel
def _is_finite(states: FloatArray, episode: int) -> bool:
    """Whether the states of one episode are finite; a NaN stays in its cell until the end."""
    for cell in range(states.shape[0]):
        for lane in range(CONTROL_LANES):
            if not np.isfinite(states[cell, episode, lane]):
                return False
    return True
