"""Motion of robot and ball over one step with what they run into.

The scheme is Box2D's. Contacts at the start of the step change the velocities and then correct
overlaps. Where the move meets the light or a wall it is cut: the robot is put there, its velocities
are solved again, and the rest of the step goes on from there. The ball and the robot, both moving,
meet only in steps' beginnings.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.dynamics import limit_speeds, move_ball, move_robot, turn_to
from ncrs_envs.batched.impact import time_of_impact
from ncrs_envs.batched.impulses import correct_positions, solve_velocities
from ncrs_envs.batched.layout import (
    QUAD_LOW_Y,
    QUAD_SIZE,
    ROBOT_RADIUS,
    SCENARIO_HEADER,
    SCENARIO_QUADS,
    SCENARIO_SEEN_X,
    SCENARIO_SEEN_Y,
    SETTING_HAS_BALL,
    STATE_ANGLE,
    STATE_BALL_X,
    STATE_BALL_Y,
    STATE_CLEARANCE,
    STATE_MEMORY,
    STATE_TOUCHED,
    STATE_VX,
    STATE_VY,
    STATE_X,
    STATE_Y,
)
from ncrs_envs.batched.manifolds import (
    LINEAR_SLOP,
    SKIN,
    distance_from_quad,
    find_contacts,
    keep_impulses,
    near_quads,
)
from ncrs_envs.physics import BALL_RADIUS, DT, LIGHT_RADIUS, MAX_TRANSLATION

# Overlap correction: part of an overlap removed at a time, sweeps, and overlap of skins left over.
_STEP_SHARE = 0.2
_STEP_SWEEPS = 60
_STEP_TOLERATED = 3.0 * LINEAR_SLOP
_IMPACT_SHARE = 0.75
_IMPACT_SWEEPS = 20
_IMPACT_TOLERATED = 1.5 * LINEAR_SLOP
_MAX_IMPACTS = 8
"""Impacts solved in one step; at one more the robot stays where it is until the next step."""


@kernel
def _clearance(
    robot: NDArray[np.float64], scenario: NDArray[np.float64], state: NDArray[np.float64]
) -> float:
    """A lower bound on how far the robot can move before it touches the light or a wall."""
    x = state[STATE_X]
    y = state[STATE_Y]
    from_x = scenario[SCENARIO_SEEN_X] - x
    from_y = scenario[SCENARIO_SEEN_Y] - y
    least = math.sqrt(from_x * from_x + from_y * from_y) - LIGHT_RADIUS
    for i in range(int(scenario[SCENARIO_QUADS])):
        quad = SCENARIO_HEADER + QUAD_SIZE * i
        if scenario[quad + QUAD_LOW_Y] - y > least:
            break
        least = min(least, distance_from_quad(scenario, quad, x, y))
    return float(least - robot[ROBOT_RADIUS] - 2.0 * SKIN)


@kernel
def _is_free(
    settings: NDArray[np.float64],
    robot: NDArray[np.float64],
    scenario: NDArray[np.float64],
    state: NDArray[np.float64],
) -> bool:
    """Whether the robot touches nothing and, at its present velocity, cannot in this step."""
    if settings[SETTING_HAS_BALL] != 0.0:
        reach = robot[ROBOT_RADIUS] + BALL_RADIUS + SKIN
        x = state[STATE_BALL_X] - state[STATE_X]
        y = state[STATE_BALL_Y] - state[STATE_Y]
        return bool(x * x + y * y > reach * reach)
    squared = state[STATE_VX] * state[STATE_VX] + state[STATE_VY] * state[STATE_VY]
    travel = min(DT * math.sqrt(squared), MAX_TRANSLATION)
    if state[STATE_CLEARANCE] <= travel:
        state[STATE_CLEARANCE] = _clearance(robot, scenario, state)
    is_free = state[STATE_CLEARANCE] > travel
    state[STATE_CLEARANCE] -= travel
    return bool(is_free)


@kernel
def move_with_contacts(
    settings: NDArray[np.float64],
    robot: NDArray[np.float64],
    cells: NDArray[np.int32],
    scenario: NDArray[np.float64],
    state: NDArray[np.float64],
    scratch: NDArray[np.float64],
) -> None:
    """Move robot and ball for one step; the velocities already hold the wheels' and the drag's
    part."""
    has_ball = settings[SETTING_HAS_BALL] != 0.0
    state[STATE_TOUCHED] = 0.0
    if _is_free(settings, robot, scenario, state):
        state[STATE_MEMORY] = 0.0
        limit_speeds(state)
        move_robot(state, DT)
        if has_ball:
            move_ball(state)
        return
    state[STATE_CLEARANCE] = 0.0
    robot_from = (state[STATE_X], state[STATE_Y], state[STATE_ANGLE])
    near = near_quads(robot, scenario, state)
    count = find_contacts(settings, robot, cells, scenario, near, state, scratch)
    if count > 0:
        state[STATE_TOUCHED] = 1.0
        solve_velocities(robot, state, scratch, count, True)
    keep_impulses(state, scratch, count)
    limit_speeds(state)
    move_robot(state, DT)
    if has_ball:
        move_ball(state)
    if count > 0:
        correct_positions(robot, state, scratch, count, _STEP_SHARE, _STEP_SWEEPS, _STEP_TOLERATED)
    if not has_ball:
        _stop_at_impacts(settings, robot, cells, scenario, near, state, scratch, robot_from)


@kernel
def _stop_at_impacts(
    settings: NDArray[np.float64],
    robot: NDArray[np.float64],
    cells: NDArray[np.int32],
    scenario: NDArray[np.float64],
    near: tuple[int, int],
    state: NDArray[np.float64],
    scratch: NDArray[np.float64],
    robot_from: tuple[float, float, float],
) -> None:
    """Cut the robot's move from ``robot_from`` where it meets something static, and go on."""
    left = 1.0
    for impact in range(_MAX_IMPACTS + 1):
        last = impact == _MAX_IMPACTS
        time = time_of_impact(robot, cells, scenario, near, state, robot_from, scratch, last)
        if time >= 1.0:
            return
        state[STATE_X] = robot_from[0] + time * (state[STATE_X] - robot_from[0])
        state[STATE_Y] = robot_from[1] + time * (state[STATE_Y] - robot_from[1])
        turn_to(state, robot_from[2] + time * (state[STATE_ANGLE] - robot_from[2]))
        left *= 1.0 - time
        count = find_contacts(settings, robot, cells, scenario, near, state, scratch)
        state[STATE_TOUCHED] = 1.0
        correct_positions(
            robot, state, scratch, count, _IMPACT_SHARE, _IMPACT_SWEEPS, _IMPACT_TOLERATED
        )
        solve_velocities(robot, state, scratch, count, False)
        if last:
            return
        robot_from = (state[STATE_X], state[STATE_Y], state[STATE_ANGLE])
        move_robot(state, left * DT)
