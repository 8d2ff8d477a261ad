"""What a robot senses and what it earns, from the poses after a step."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.dynamics import grid_center
from ncrs_envs.batched.layout import (
    CELLS_GRID_SIZE,
    CELLS_HEADER,
    CELLS_SENSORS,
    ROBOT_HEADER,
    SCENARIO_SEEN_X,
    SCENARIO_SEEN_Y,
    SCENARIO_TARGET_X,
    SCENARIO_TARGET_Y,
    SETTING_EXTENT,
    SETTING_HAS_BALL,
    SETTING_INVERSE_SQUARE,
    SETTING_SUCCESS_RADIUS,
    STATE_BALL_X,
    STATE_BALL_Y,
    STATE_CLOSEST,
    STATE_COS,
    STATE_CROSSED,
    STATE_SIN,
    STATE_SUCCESS,
    STATE_X,
    STATE_Y,
)


@kernel
def _score(distance: float, extent: float, inverse_square: bool) -> float:
    """See ``tasks.distance_score``."""
    if inverse_square:
        closeness = 1.0 / (distance / extent + 1.0)
        return closeness * closeness
    return math.exp(-distance / extent)


@kernel
def _seen_point(
    settings: NDArray[np.float64], scenario: NDArray[np.float64], state: NDArray[np.float64]
) -> tuple[float, float]:
    """What light sensors sense: the light, or the ball where it is now."""
    if settings[SETTING_HAS_BALL] != 0.0:
        return state[STATE_BALL_X], state[STATE_BALL_Y]
    return scenario[SCENARIO_SEEN_X], scenario[SCENARIO_SEEN_Y]


@kernel
def sense(
    settings: NDArray[np.float64],
    robot: NDArray[np.float64],
    cells: NDArray[np.int32],
    scenario: NDArray[np.float64],
    state: NDArray[np.float64],
    observation: NDArray[np.floating],
) -> None:
    """Write the sensor values in (0, 1] into the sensor cells of a flat grid.

    Other cells are left as they are; ``simulate.reset_run`` sets them to 0.
    """
    places = cells[CELLS_GRID_SIZE] * cells[CELLS_GRID_SIZE]
    points = ROBOT_HEADER + 3 * places
    indices = CELLS_HEADER + places
    extent = settings[SETTING_EXTENT]
    inverse_square = settings[SETTING_INVERSE_SQUARE] != 0.0
    seen_x, seen_y = _seen_point(settings, scenario, state)
    cos = state[STATE_COS]
    sin = state[STATE_SIN]
    for sensor in range(cells[CELLS_SENSORS]):
        local_x = robot[points + 2 * sensor]
        local_y = robot[points + 2 * sensor + 1]
        x = state[STATE_X] + cos * local_x - sin * local_y
        y = state[STATE_Y] + sin * local_x + cos * local_y
        if cells[indices + places + sensor] != 0:
            x -= scenario[SCENARIO_TARGET_X]
            y -= scenario[SCENARIO_TARGET_Y]
        else:
            x -= seen_x
            y -= seen_y
        distance = math.sqrt(x * x + y * y)
        observation[cells[indices + sensor]] = _score(distance, extent, inverse_square)


@kernel
def distances(
    settings: NDArray[np.float64],
    robot: NDArray[np.float64],
    scenario: NDArray[np.float64],
    state: NDArray[np.float64],
) -> tuple[float, float]:
    """Units: robot to light or ball, and ball to target (0 in tasks without a ball)."""
    x, y = grid_center(robot, state)
    seen_x, seen_y = _seen_point(settings, scenario, state)
    to_seen = math.sqrt((x - seen_x) * (x - seen_x) + (y - seen_y) * (y - seen_y))
    to_target = 0.0
    if settings[SETTING_HAS_BALL] != 0.0:
        x = seen_x - scenario[SCENARIO_TARGET_X]
        y = seen_y - scenario[SCENARIO_TARGET_Y]
        to_target = math.sqrt(x * x + y * y)
    return to_seen, to_target


@kernel
def score(
    settings: NDArray[np.float64],
    robot: NDArray[np.float64],
    scenario: NDArray[np.float64],
    state: NDArray[np.float64],
) -> float:
    """The reward of the current poses; also keeps the state's record of what was reached."""
    extent = settings[SETTING_EXTENT]
    inverse_square = settings[SETTING_INVERSE_SQUARE] != 0.0
    to_seen, to_target = distances(settings, robot, scenario, state)
    reward = _score(to_seen, extent, inverse_square)
    decisive = to_seen
    if settings[SETTING_HAS_BALL] != 0.0:
        reward = 0.5 * (reward + _score(to_target, extent, inverse_square))
        decisive = to_target
    state[STATE_CLOSEST] = min(state[STATE_CLOSEST], to_seen)
    state[STATE_CLOSEST + 1] = min(state[STATE_CLOSEST + 1], to_target)
    if decisive <= settings[SETTING_SUCCESS_RADIUS]:
        state[STATE_SUCCESS] = 1.0
    _, y = grid_center(robot, state)
    if y > 0.0:
        state[STATE_CROSSED] = 1.0
    return reward
