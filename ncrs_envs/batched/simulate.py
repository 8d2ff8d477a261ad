"""Reset and step of one robot in one episode: the kernels that batched callers use.

Every kernel works on one episode and changes only its arguments, so callers may spread episodes
over threads in any way with the same results. Nothing is allocated inside a step.

An episode is ``reset_episode(...)``, then ``step_episode(...)`` as often as needed. They take:

- ``world``: Inputs of the steps and the solver's buffers, which threads must not share. It is made
  by ``make_world`` from the records of many robots and scenarios, which ``records`` fills.
- ``state``: One for each episode. Success, crossed and touched are read from it.
- ``action`` and ``observation``: Flat grids ``(n * n,)`` of float32 or float64, row by row.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import inlined, kernel
from ncrs_envs.batched.contacts import move_with_contacts
from ncrs_envs.batched.dynamics import apply_drag, apply_wheels
from ncrs_envs.batched.layout import State, World, Worlds
from ncrs_envs.batched.sensing import distances, score, sense, update_progress


def make_world(worlds: Worlds, robot: int, scenario: int) -> World:
    """Return the world of a robot in a scenario, given their indices."""
    return World(
        worlds.settings,
        worlds.robots.robots[robot],
        worlds.robots.wheels[robot],
        worlds.robots.sensors[robot],
        worlds.robots.exposed[robot],
        worlds.scenarios.scenarios[scenario],
        worlds.scenarios.quads[scenario],
        worlds.scratch.contacts,
        worlds.scratch.corners,
    )


world_at = inlined(make_world)
"""``make_world`` in kernels."""


@kernel
def reset_episode(world: World, state: State, observation: NDArray[np.floating]) -> None:
    """Place robot and ball at rest as in the scenario, and write the first observation."""
    state.x = world.scenario.start_x + world.robot.center_x
    state.y = world.scenario.start_y + world.robot.center_y
    state.angle = 0.0
    state.vx = 0.0
    state.vy = 0.0
    state.omega = 0.0
    state.cos = 1.0
    state.sin = 0.0
    state.ball_x = world.scenario.goal_x if world.settings.has_ball else 0.0
    state.ball_y = world.scenario.goal_y if world.settings.has_ball else 0.0
    state.ball_vx = 0.0
    state.ball_vy = 0.0
    state.ball_omega = 0.0
    state.clearance = 0.0
    state.closest_goal = np.inf
    state.closest_target = np.inf
    state.success = False
    state.crossed = False
    state.touched = False
    state.contact_count = 0
    state.memory_count = 0
    for place in range(observation.shape[0]):
        observation[place] = 0.0
    sense(world, state, observation)


@kernel
def step_episode(
    world: World, state: State, action: NDArray[np.floating], observation: NDArray[np.floating]
) -> float:
    """Advance one step of ``DT`` seconds and return the reward.

    Args:
        world: The episode's world.
        state: The episode's state, changed.
        action: Finite gas per cell; read in wheel cells, clipped to [-1, 1].
        observation: Output; only sensor cells are written.
    """
    push_robot(world, state, action)
    move_with_contacts(world, state)
    return observe(world, state, observation)


@inlined
def push_robot(world: World, state: State, action: NDArray[np.floating]) -> None:
    """Change the velocities by wheels and drag: the first part of ``step_episode``."""
    apply_wheels(world, state, action)
    if world.settings.has_ball:
        apply_drag(state)


@inlined
def observe(world: World, state: State, observation: NDArray[np.floating]) -> float:
    """Write the sensor values, update the progress and return the reward: the last part."""
    sense(world, state, observation)
    to_goal, to_target = distances(world, state)
    update_progress(world, state, to_goal, to_target)
    return score(world.settings, to_goal, to_target)
