"""Sensor values and rewards, from the poses after a step."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.dynamics import grid_center
from ncrs_envs.batched.layout import Sensor, Settings, State, World
from ncrs_envs.batched.manifolds import touches_wall
from ncrs_envs.physics import TOUCH_DECAY


@kernel
def _closeness(settings: Settings, distance: float) -> float:
    """Return the distance score; see ``tasks.distance_score``."""
    if settings.inverse_square:
        closeness = 1.0 / (distance / settings.extent + 1.0)
        return closeness * closeness
    return math.exp(-distance / settings.extent)


@kernel
def _goal(world: World, state: State) -> tuple[float, float]:
    """Return the position of the goal: the light, or the ball at its present place."""
    if world.settings.has_ball:
        return state.ball_x, state.ball_y
    return world.scenario.goal_x, world.scenario.goal_y


@kernel
def sense(world: World, state: State, observation: NDArray[np.floating]) -> None:
    """Write the sensor values in [0, 1] into the sensor cells of a flat grid.

    Touch sensors read their last value there. Other cells are not changed;
    ``simulate.reset_episode`` sets them to 0.
    """
    goal_x, goal_y = _goal(world, state)
    cos = state.cos
    sin = state.sin
    for i in range(world.robot.sensor_count):
        sensor: Sensor = world.sensors[i]
        if sensor.senses_touch:
            if touches_wall(world, state.contact_count, sensor.exposed):
                observation[sensor.place] = 1.0
            else:
                observation[sensor.place] *= TOUCH_DECAY
            continue
        x = state.x + cos * sensor.x - sin * sensor.y
        y = state.y + sin * sensor.x + cos * sensor.y
        if sensor.senses_target:
            x -= world.scenario.target_x
            y -= world.scenario.target_y
        else:
            x -= goal_x
            y -= goal_y
        distance = math.sqrt(x * x + y * y)
        observation[sensor.place] = _closeness(world.settings, distance)


@kernel
def distances(world: World, state: State) -> tuple[float, float]:
    """Return the distances, in units, of robot to goal and ball to target (0 without a ball)."""
    x, y = grid_center(world.robot, state)
    goal_x, goal_y = _goal(world, state)
    to_goal = math.sqrt((x - goal_x) * (x - goal_x) + (y - goal_y) * (y - goal_y))
    to_target = 0.0
    if world.settings.has_ball:
        x = goal_x - world.scenario.target_x
        y = goal_y - world.scenario.target_y
        to_target = math.sqrt(x * x + y * y)
    return to_goal, to_target


@kernel
def score(settings: Settings, to_goal: float, to_target: float) -> float:
    """Return the reward at the given distances."""
    reward = _closeness(settings, to_goal)
    if settings.has_ball:
        reward = 0.5 * (reward + _closeness(settings, to_target))
    return reward


@kernel
def update_progress(world: World, state: State, to_goal: float, to_target: float) -> None:
    """Update the state's closest approaches, success and crossing."""
    state.closest_goal = min(state.closest_goal, to_goal)
    state.closest_target = min(state.closest_target, to_target)
    decisive = to_target if world.settings.has_ball else to_goal
    if decisive <= world.settings.success_radius:
        state.success = True
    _, y = grid_center(world.robot, state)
    if y > 0.0:
        state.crossed = True
