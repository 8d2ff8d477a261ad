"""Motion of robot and ball over one step, with contacts.

The scheme is Box2D's. Contacts at the start of the step change the velocities and then correct
overlaps. Where the move meets the light or a wall it is cut: the robot is placed there, its
velocities are solved again, and the rest of the step continues from there. The ball and the robot
both move; contacts between them are found only at the start of a step.
"""

from __future__ import annotations

import math

from ncrs_envs.batched.compiler import inlined, kernel
from ncrs_envs.batched.dynamics import limit_speeds, move_ball, move_robot, turn_to
from ncrs_envs.batched.impact import Pose, time_of_impact
from ncrs_envs.batched.impulses import Correction, correct_positions, solve_velocities
from ncrs_envs.batched.layout import Quad, State, World
from ncrs_envs.batched.manifolds import (
    LINEAR_SLOP,
    SKIN,
    distance_from_quad,
    find_contacts,
    keep_impulses,
    near_quads,
)
from ncrs_envs.physics import BALL_RADIUS, DT, LIGHT_RADIUS, MAX_TRANSLATION

_AFTER_MOVE = Correction(fraction=0.2, sweeps=60, tolerated=3.0 * LINEAR_SLOP)
_AT_IMPACT = Correction(fraction=0.75, sweeps=20, tolerated=1.5 * LINEAR_SLOP)
MAX_IMPACTS = 8
"""Maximum number of impacts in one step; after one more the robot stops until the next step."""


@kernel
def _clearance(world: World, state: State) -> float:
    """Return a lower bound on the robot's distance from the light and the walls."""
    x = state.x
    y = state.y
    from_x = world.scenario.goal_x - x
    from_y = world.scenario.goal_y - y
    nearest = math.sqrt(from_x * from_x + from_y * from_y) - LIGHT_RADIUS
    for i in range(world.scenario.quad_count):
        quad: Quad = world.quads[i]
        if quad.low_y - y > nearest:
            break
        nearest = min(nearest, distance_from_quad(quad, x, y))
    return nearest - world.robot.radius - 2.0 * SKIN


@kernel
def _is_free(world: World, state: State) -> bool:
    """Return True if the robot touches nothing and, at its velocity, cannot do so in this step."""
    if world.settings.has_ball:
        reach = world.robot.radius + BALL_RADIUS + SKIN
        x = state.ball_x - state.x
        y = state.ball_y - state.y
        return x * x + y * y > reach * reach
    squared = state.vx * state.vx + state.vy * state.vy
    travel = min(DT * math.sqrt(squared), MAX_TRANSLATION)
    if state.clearance <= travel:
        state.clearance = _clearance(world, state)
    is_free = state.clearance > travel
    state.clearance -= travel
    return is_free


@kernel
def move_with_contacts(world: World, state: State) -> None:
    """Move robot and ball for one step.

    The velocities already include the effects of wheels and drag.
    """
    if move_if_free(world, state):
        return
    start = Pose(state.x, state.y, state.angle)
    near = near_quads(world, state)
    move_in_contact(world, state, find_contacts(world, near, state))
    if not world.settings.has_ball:
        _stop_at_impacts(world, near, state, start)


@inlined
def move_if_free(world: World, state: State) -> bool:
    """Move robot and ball for one step if the robot can touch nothing in it, else return False."""
    state.touched = False
    state.contact_count = 0
    if not _is_free(world, state):
        state.clearance = 0.0
        return False
    state.memory_count = 0
    _move(world, state)
    return True


@inlined
def _move(world: World, state: State) -> None:
    """Move robot and ball for one step at their velocities."""
    limit_speeds(state)
    move_robot(state, DT)
    if world.settings.has_ball:
        move_ball(state)


@kernel
def move_in_contact(world: World, state: State, count: int) -> None:
    """Solve the velocities at ``count`` contact points, move for one step and correct overlaps."""
    contacts = world.contacts[:count]
    state.contact_count = count
    if count > 0:
        state.touched = True
        solve_velocities(world.robot, state, contacts, True)
    keep_impulses(state, contacts)
    _move(world, state)
    if count > 0:
        correct_positions(world.robot, state, contacts, _AFTER_MOVE)


@kernel
def move_back(state: State, start: Pose, time: float) -> None:
    """Place the robot where it is after the fraction ``time`` of its move from ``start``."""
    state.x = start.x + time * (state.x - start.x)
    state.y = start.y + time * (state.y - start.y)
    turn_to(state, start.angle + time * (state.angle - start.angle))


@kernel
def solve_impact(world: World, state: State, count: int) -> None:
    """Correct overlaps at ``count`` contact points where a move was cut, and solve velocities."""
    contacts = world.contacts[:count]
    state.contact_count = count
    state.touched = True
    correct_positions(world.robot, state, contacts, _AT_IMPACT)
    solve_velocities(world.robot, state, contacts, False)


@kernel
def _stop_at_impacts(world: World, near: tuple[int, int], state: State, start: Pose) -> None:
    """Cut the robot's move from ``start`` where it meets the light or a wall, and continue."""
    remaining = 1.0
    for impact in range(MAX_IMPACTS + 1):
        last = impact == MAX_IMPACTS
        time = time_of_impact(world, near, start, state, last)
        if time >= 1.0:
            return
        move_back(state, start, time)
        remaining *= 1.0 - time
        solve_impact(world, state, find_contacts(world, near, state))
        if last:
            return
        start = Pose(state.x, state.y, state.angle)
        move_robot(state, remaining * DT)
