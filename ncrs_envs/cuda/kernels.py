"""Start and step of many environments on a GPU: one thread for each of them.

The physics, and the drawing of scenarios from random streams, are those of ``ncrs_envs.batched``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import cuda
from numpy.typing import NDArray

from ncrs_envs.batched.contacts import move_with_contacts
from ncrs_envs.batched.dynamics import grid_center
from ncrs_envs.batched.layout import (
    MAX_CORNERS,
    Contact,
    Point,
    Robots,
    Scenarios,
    Settings,
    State,
    World,
)
from ncrs_envs.batched.sampling import RANDOM_REGION, Room, Walls, draw_obstacle, draw_points
from ncrs_envs.batched.sensing import distances
from ncrs_envs.batched.simulate import observe, push_robot, reset_episode
from ncrs_envs.cuda.gpu import POINT, device_function, gpu_kernel, inlined_on_gpu, reused

_push_robot = reused(push_robot)
_observe = reused(observe)

LEAVE, KEEP, DRAW = 0, 1, 2
"""What starts in an environment: nothing, an episode in the scenario that it has, or in one that is
drawn."""


class Fleet(NamedTuple):
    """Robots, scenarios and states of the environments; the first axis is theirs."""

    settings: NDArray[Settings]
    """A single record."""
    robots: Robots
    scenarios: Scenarios
    states: NDArray[State]
    contacts: NDArray[Contact]
    """``(count, capacity)``."""
    streams: NDArray[np.uint64]
    """Random streams, ``(count, STREAM_SIZE)``."""
    walls: Walls
    """Room for walls while they are drawn: a first axis on all three; of 1 in tasks without."""
    failures: NDArray[np.int64]
    """Number of scenarios that could not be drawn, ``(1,)``."""


class Readings(NamedTuple):
    """What the environments show after a step; the first axis is theirs."""

    observations: NDArray[np.float32]
    """``(count, n * n)``."""
    poses: NDArray[np.float64]
    """x and y of the grid's centre in units, and the angle in radians, ``(count, 3)``."""
    distances: NDArray[np.float64]
    """Units from the robot to its goal, and from the ball to the target, ``(count, 2)``."""
    success: NDArray[np.bool_]
    crossed: NDArray[np.bool_]


class Turn(NamedTuple):
    """Actions of a step, and its results beside the readings, each ``(count,)``."""

    actions: NDArray[np.float32]
    """Finite gas per cell, ``(count, n * n)``."""
    rewards: NDArray[np.float64]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    is_done: NDArray[np.bool_]
    """True where the episode has ended and no other has been started."""
    steps: NDArray[np.int64]
    """Number of steps of the present episode."""


class Rules(NamedTuple):
    """How episodes are drawn, end and are followed by others."""

    room: Room
    has_walls: bool
    step_limit: int
    terminates: bool
    """True if success ends an episode."""
    resets_at_once: bool
    """True for Gymnasium's ``SAME_STEP``."""


@inlined_on_gpu
def _world(fleet: Fleet, env: int, corners: NDArray[Point]) -> World:
    return World(
        fleet.settings[0],
        fleet.robots.robots[env],
        fleet.robots.wheels[env],
        fleet.robots.sensors[env],
        fleet.robots.exposed[env],
        fleet.scenarios.scenarios[env],
        fleet.scenarios.quads[env],
        fleet.contacts[env],
        corners,
    )


@device_function
def _draw(fleet: Fleet, rules: Rules, env: int, region: int) -> None:
    stream, record = fleet.streams[env], fleet.scenarios.scenarios[env]
    if not rules.has_walls:
        draw_points(stream, region, fleet.settings[0].has_ball, rules.room, record)
        return
    walls = Walls(fleet.walls.counts[env], fleet.walls.vertices[env], fleet.walls.quads[env])
    quads = fleet.scenarios.quads[env]
    if not draw_obstacle(stream, region, rules.room, walls, record, quads):
        cuda.atomic.add(fleet.failures, 0, 1)


@device_function
def _read(world: World, state: State, readings: Readings, env: int) -> None:
    x, y = grid_center(world.robot, state)
    to_goal, to_target = distances(world, state)
    readings.poses[env, 0] = x
    readings.poses[env, 1] = y
    readings.poses[env, 2] = state.angle
    readings.distances[env, 0] = to_goal
    readings.distances[env, 1] = to_target
    readings.success[env] = state.success
    readings.crossed[env] = state.crossed


@gpu_kernel
def start_envs(
    fleet: Fleet,
    readings: Readings,
    turn: Turn,
    rules: Rules,
    what: tuple[NDArray[np.int8], NDArray[np.int64]],
) -> None:
    """Start episodes.

    Args:
        fleet: The environments.
        readings: Output.
        turn: Output, of which steps and ends are reset.
        rules: Rules of the episodes.
        what: ``LEAVE``, ``KEEP`` or ``DRAW``, and the regions of what is drawn, each ``(count,)``.
    """
    env = cuda.grid(1)
    kinds, regions = what
    if env >= kinds.shape[0] or kinds[env] == LEAVE:
        return
    if kinds[env] == DRAW:
        _draw(fleet, rules, env, regions[env])
    world = _world(fleet, env, cuda.local.array(MAX_CORNERS, POINT))
    state = fleet.states[env]
    reset_episode(world, state, readings.observations[env])
    _read(world, state, readings, env)
    turn.steps[env] = 0
    turn.is_done[env] = False


@gpu_kernel
def step_envs(
    fleet: Fleet,
    readings: Readings,
    last: Readings,
    turn: Turn,
    rules: Rules,
) -> None:
    """Advance every environment by one step, or start its next episode.

    Args:
        fleet: The environments.
        readings: Output, after the step or the start.
        last: Output, readings of the episodes that end here, if others follow at once.
        turn: Actions, and output; ``is_done`` and ``steps`` are changed.
        rules: Rules of the episodes.
    """
    env = cuda.grid(1)
    if env >= turn.steps.shape[0]:
        return
    world = _world(fleet, env, cuda.local.array(MAX_CORNERS, POINT))
    state, observation = fleet.states[env], readings.observations[env]
    reward, steps = 0.0, 0
    starts = turn.is_done[env]
    if not starts:
        _push_robot(world, state, turn.actions[env])
        move_with_contacts(world, state)
        reward = _observe(world, state, observation)
        steps = turn.steps[env] + 1
        _read(world, state, readings, env)
    terminated = not starts and rules.terminates and state.success
    truncated = steps >= rules.step_limit
    is_done = terminated or truncated
    if is_done and rules.resets_at_once:
        _read(world, state, last, env)
        for place in range(observation.shape[0]):
            last.observations[env, place] = observation[place]
        starts, steps = True, 0
    if starts:
        _draw(fleet, rules, env, RANDOM_REGION)
        reset_episode(world, state, observation)
        _read(world, state, readings, env)
    turn.rewards[env] = reward
    turn.terminated[env] = terminated
    turn.truncated[env] = truncated
    turn.is_done[env] = is_done and not rules.resets_at_once
    turn.steps[env] = steps


@gpu_kernel
def scatter(
    chosen: NDArray[np.int64], rows: NDArray[np.uint64], records: NDArray[np.uint64]
) -> None:
    """Put rows, or the only one, in the places of chosen records, by words; one thread for each.

    Args:
        chosen: Indices of records.
        rows: ``(len(chosen) or 1, words)``.
        records: Output, ``(count, words)`` or longer.
    """
    item = cuda.grid(1)
    if item < chosen.shape[0]:
        row = min(item, rows.shape[0] - 1)
        for word in range(rows.shape[1]):
            records[chosen[item], word] = rows[row, word]
