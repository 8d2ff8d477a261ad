"""Sequential impulses on contact points, and the correction of overlaps.

Restitution is 0. Both loops stop early once nothing changes any more.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.dynamics import BALL_INVERSE_INERTIA, BALL_INVERSE_MASS, turn_to
from ncrs_envs.batched.layout import (
    ROBOT_INVERSE_INERTIA,
    ROBOT_INVERSE_MASS,
    STATE_ANGLE,
    STATE_BALL_OMEGA,
    STATE_BALL_VX,
    STATE_BALL_VY,
    STATE_BALL_X,
    STATE_BALL_Y,
    STATE_COS,
    STATE_OMEGA,
    STATE_SIN,
    STATE_VX,
    STATE_VY,
    STATE_X,
    STATE_Y,
)
from ncrs_envs.batched.manifolds import (
    ARM_X,
    ARM_Y,
    BALL_ARM_X,
    BALL_ARM_Y,
    FACE_NX,
    FACE_NY,
    FACE_OF_WALL,
    FACE_RADIUS,
    FACE_TO_BALL,
    FACE_X,
    FACE_Y,
    KIND,
    LINEAR_SLOP,
    NORMAL_IMPULSE,
    NORMAL_MASS,
    NORMAL_X,
    NORMAL_Y,
    POINT_X,
    POINT_Y,
    RADII,
    TANGENT_IMPULSE,
    TANGENT_MASS,
    contact_at,
)
from ncrs_envs.physics import CONTACT_FRICTION

_VELOCITY_ITERATIONS = 180
_SETTLED_SPEED = 1e-6
"""Units per second: smaller changes of a contact point's speed end the iteration."""
_MAX_CORRECTION = 0.2


@kernel
def _locate(
    scratch: NDArray[np.float64], contact: int, state: NDArray[np.float64]
) -> tuple[float, float, float, float, float]:
    """World normal towards the robot, world position and separation of a contact point."""
    cos = state[STATE_COS]
    sin = state[STATE_SIN]
    n_x = scratch[contact + FACE_NX]
    n_y = scratch[contact + FACE_NY]
    f_x = scratch[contact + FACE_X]
    f_y = scratch[contact + FACE_Y]
    p_x = scratch[contact + POINT_X]
    p_y = scratch[contact + POINT_Y]
    if scratch[contact + KIND] == FACE_OF_WALL:
        x = state[STATE_X] + cos * p_x - sin * p_y
        y = state[STATE_Y] + sin * p_x + cos * p_y
        distance = n_x * (x - f_x) + n_y * (y - f_y)
        return n_x, n_y, x, y, distance - scratch[contact + RADII]
    if scratch[contact + KIND] == FACE_TO_BALL:
        p_x = state[STATE_BALL_X]
        p_y = state[STATE_BALL_Y]
    out_x = cos * n_x - sin * n_y
    out_y = sin * n_x + cos * n_y
    x = state[STATE_X] + cos * f_x - sin * f_y
    y = state[STATE_Y] + sin * f_x + cos * f_y
    distance = out_x * (p_x - x) + out_y * (p_y - y)
    return -out_x, -out_y, p_x, p_y, distance - scratch[contact + RADII]


@kernel
def _push(
    robot: NDArray[np.float64],
    state: NDArray[np.float64],
    scratch: NDArray[np.float64],
    contact: int,
    impulse_x: float,
    impulse_y: float,
) -> None:
    """Apply an impulse to the robot at a contact point, and its reaction to the ball."""
    arm_x = scratch[contact + ARM_X]
    arm_y = scratch[contact + ARM_Y]
    state[STATE_VX] += robot[ROBOT_INVERSE_MASS] * impulse_x
    state[STATE_VY] += robot[ROBOT_INVERSE_MASS] * impulse_y
    state[STATE_OMEGA] += robot[ROBOT_INVERSE_INERTIA] * (arm_x * impulse_y - arm_y * impulse_x)
    if scratch[contact + KIND] == FACE_TO_BALL:
        arm_x = scratch[contact + BALL_ARM_X]
        arm_y = scratch[contact + BALL_ARM_Y]
        state[STATE_BALL_VX] -= BALL_INVERSE_MASS * impulse_x
        state[STATE_BALL_VY] -= BALL_INVERSE_MASS * impulse_y
        state[STATE_BALL_OMEGA] -= BALL_INVERSE_INERTIA * (arm_x * impulse_y - arm_y * impulse_x)


@kernel
def _prepare(
    robot: NDArray[np.float64],
    state: NDArray[np.float64],
    scratch: NDArray[np.float64],
    count: int,
    keep: bool,
) -> None:
    """Fill what depends on the poses at the start of the solve, and apply the first impulses."""
    inverse_mass = robot[ROBOT_INVERSE_MASS]
    inverse_inertia = robot[ROBOT_INVERSE_INERTIA]
    for i in range(count):
        contact = contact_at(i)
        n_x, n_y, x, y, separation = _locate(scratch, contact, state)
        # Forces act midway between the two surfaces, along the face's outward normal.
        outward = 1.0 if scratch[contact + KIND] == FACE_OF_WALL else -1.0
        radii = scratch[contact + RADII]
        middle = 0.5 * (2.0 * scratch[contact + FACE_RADIUS] - radii - (separation + radii))
        x += middle * outward * n_x
        y += middle * outward * n_y
        arm_x = x - state[STATE_X]
        arm_y = y - state[STATE_Y]
        normal_arm = arm_x * n_y - arm_y * n_x
        tangent_arm = arm_x * n_x + arm_y * n_y
        by_normal = inverse_mass + inverse_inertia * normal_arm * normal_arm
        by_tangent = inverse_mass + inverse_inertia * tangent_arm * tangent_arm
        if scratch[contact + KIND] == FACE_TO_BALL:
            ball_x = x - state[STATE_BALL_X]
            ball_y = y - state[STATE_BALL_Y]
            normal_arm = ball_x * n_y - ball_y * n_x
            tangent_arm = ball_x * n_x + ball_y * n_y
            by_normal += BALL_INVERSE_MASS + BALL_INVERSE_INERTIA * normal_arm * normal_arm
            by_tangent += BALL_INVERSE_MASS + BALL_INVERSE_INERTIA * tangent_arm * tangent_arm
            scratch[contact + BALL_ARM_X] = ball_x
            scratch[contact + BALL_ARM_Y] = ball_y
        scratch[contact + NORMAL_X] = n_x
        scratch[contact + NORMAL_Y] = n_y
        scratch[contact + ARM_X] = arm_x
        scratch[contact + ARM_Y] = arm_y
        scratch[contact + NORMAL_MASS] = 1.0 / by_normal
        scratch[contact + TANGENT_MASS] = 1.0 / by_tangent
        normal = scratch[contact + NORMAL_IMPULSE] if keep else 0.0
        tangent = scratch[contact + TANGENT_IMPULSE] if keep else 0.0
        scratch[contact + NORMAL_IMPULSE] = normal
        scratch[contact + TANGENT_IMPULSE] = tangent
        _push(
            robot,
            state,
            scratch,
            contact,
            normal * n_x - tangent * n_y,
            normal * n_y + tangent * n_x,
        )


@kernel
def _approach(
    state: NDArray[np.float64], scratch: NDArray[np.float64], contact: int
) -> tuple[float, float]:
    """Velocity of the robot at a contact point relative to what it touches."""
    v_x = state[STATE_VX] - state[STATE_OMEGA] * scratch[contact + ARM_Y]
    v_y = state[STATE_VY] + state[STATE_OMEGA] * scratch[contact + ARM_X]
    if scratch[contact + KIND] == FACE_TO_BALL:
        v_x -= state[STATE_BALL_VX] - state[STATE_BALL_OMEGA] * scratch[contact + BALL_ARM_Y]
        v_y -= state[STATE_BALL_VY] + state[STATE_BALL_OMEGA] * scratch[contact + BALL_ARM_X]
    return v_x, v_y


@kernel
def solve_velocities(
    robot: NDArray[np.float64],
    state: NDArray[np.float64],
    scratch: NDArray[np.float64],
    count: int,
    keep: bool,
) -> None:
    """Change velocities so that no contact point approaches, with Coulomb friction.

    Args:
        robot: the robot's record.
        state: the run's state, changed.
        scratch: holds the contact points.
        count: their number.
        keep: begin with the impulses of the step before rather than with none. A robot jammed
            between two faces is held by them.
    """
    _prepare(robot, state, scratch, count, keep)
    for _ in range(_VELOCITY_ITERATIONS):
        largest = 0.0
        for i in range(count):
            contact = contact_at(i)
            n_x = scratch[contact + NORMAL_X]
            n_y = scratch[contact + NORMAL_Y]
            v_x, v_y = _approach(state, scratch, contact)
            mass = scratch[contact + TANGENT_MASS]
            limit = CONTACT_FRICTION * scratch[contact + NORMAL_IMPULSE]
            old = scratch[contact + TANGENT_IMPULSE]
            new = min(max(old - mass * (n_x * v_y - n_y * v_x), -limit), limit)
            if new != old:
                scratch[contact + TANGENT_IMPULSE] = new
                _push(robot, state, scratch, contact, -(new - old) * n_y, (new - old) * n_x)
                largest = max(largest, abs(new - old) / mass)
                v_x, v_y = _approach(state, scratch, contact)
            mass = scratch[contact + NORMAL_MASS]
            old = scratch[contact + NORMAL_IMPULSE]
            new = max(old - mass * (n_x * v_x + n_y * v_y), 0.0)
            if new != old:
                scratch[contact + NORMAL_IMPULSE] = new
                _push(robot, state, scratch, contact, (new - old) * n_x, (new - old) * n_y)
                largest = max(largest, abs(new - old) / mass)
        if largest < _SETTLED_SPEED:
            break


@kernel
def correct_positions(
    robot: NDArray[np.float64],
    state: NDArray[np.float64],
    scratch: NDArray[np.float64],
    count: int,
    share: float,
    iterations: int,
    tolerated: float,
) -> None:
    """Move bodies apart along their contact normals until little overlap is left.

    Args:
        robot: the robot's record.
        state: the run's state, changed.
        scratch: holds the contact points.
        count: their number.
        share: part of an overlap that one correction removes.
        iterations: most sweeps over all points.
        tolerated: stop when no overlap of skins is larger than this.
    """
    inverse_mass = robot[ROBOT_INVERSE_MASS]
    inverse_inertia = robot[ROBOT_INVERSE_INERTIA]
    for _ in range(iterations):
        least = 0.0
        for i in range(count):
            contact = contact_at(i)
            n_x, n_y, x, y, separation = _locate(scratch, contact, state)
            least = min(least, separation)
            correction = min(max(share * -(separation + LINEAR_SLOP), 0.0), _MAX_CORRECTION)
            if correction == 0.0:
                continue
            arm_x = x - state[STATE_X]
            arm_y = y - state[STATE_Y]
            normal_arm = arm_x * n_y - arm_y * n_x
            compliance = inverse_mass + inverse_inertia * normal_arm * normal_arm
            is_ball = scratch[contact + KIND] == FACE_TO_BALL
            if is_ball:
                compliance += BALL_INVERSE_MASS
            impulse = correction / compliance
            state[STATE_X] += inverse_mass * impulse * n_x
            state[STATE_Y] += inverse_mass * impulse * n_y
            turn_to(state, state[STATE_ANGLE] + inverse_inertia * impulse * normal_arm)
            if is_ball:
                state[STATE_BALL_X] -= BALL_INVERSE_MASS * impulse * n_x
                state[STATE_BALL_Y] -= BALL_INVERSE_MASS * impulse * n_y
        if least >= -tolerated:
            break
