"""Free motion of robot and ball over one step: wheel forces, drag, limits, integration.

The order is Box2D's: forces from the velocities at the start of the step change the velocities;
contacts change them again (``contacts``); the limited velocities then move the bodies.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.layout import (
    CELLS_HEADER,
    CELLS_WHEELS,
    ROBOT_CENTER_X,
    ROBOT_CENTER_Y,
    ROBOT_DAMPING,
    ROBOT_HEADER,
    STATE_ANGLE,
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
from ncrs_envs.physics import (
    BALL_DENSITY,
    BALL_DRAG,
    BALL_RADIUS,
    DT,
    MAX_ROTATION_RAD,
    MAX_TRANSLATION,
)

BALL_INVERSE_MASS = 1.0 / (BALL_DENSITY * math.pi * BALL_RADIUS**2)
BALL_INVERSE_INERTIA = 2.0 * BALL_INVERSE_MASS / BALL_RADIUS**2
_BALL_KEPT_SPEED = 1.0 - DT * BALL_DRAG * BALL_INVERSE_MASS
_MAX_SPEED = MAX_TRANSLATION / DT
_MAX_OMEGA = MAX_ROTATION_RAD / DT


@kernel
def apply_wheels(
    robot: NDArray[np.float64],
    cells: NDArray[np.int32],
    state: NDArray[np.float64],
    action: NDArray[np.floating],
) -> None:
    """Change the robot's velocities by the wheels' thrust and friction over one step.

    Args:
        robot: the robot's record.
        cells: the robot's indices.
        state: the run's state; its velocities are changed.
        action: gas per cell, flat, shape ``(n * n,)``; clipped to [-1, 1].
    """
    cos = state[STATE_COS]
    sin = state[STATE_SIN]
    u_x = cos * state[STATE_VX] + sin * state[STATE_VY]
    u_y = cos * state[STATE_VY] - sin * state[STATE_VX]
    omega = state[STATE_OMEGA]
    d = ROBOT_DAMPING
    change_x = -(robot[d] * u_x + robot[d + 1] * u_y + robot[d + 2] * omega)
    change_y = -(robot[d + 3] * u_x + robot[d + 4] * u_y + robot[d + 5] * omega)
    change_omega = -(robot[d + 6] * u_x + robot[d + 7] * u_y + robot[d + 8] * omega)
    for wheel in range(cells[CELLS_WHEELS]):
        gas = min(max(float(action[cells[CELLS_HEADER + wheel]]), -1.0), 1.0)
        start = ROBOT_HEADER + 3 * wheel
        change_x += gas * robot[start]
        change_y += gas * robot[start + 1]
        change_omega += gas * robot[start + 2]
    state[STATE_VX] += cos * change_x - sin * change_y
    state[STATE_VY] += sin * change_x + cos * change_y
    state[STATE_OMEGA] = omega + change_omega


@kernel
def apply_drag(state: NDArray[np.float64]) -> None:
    """Change the ball's velocity by its drag over one step."""
    state[STATE_BALL_VX] *= _BALL_KEPT_SPEED
    state[STATE_BALL_VY] *= _BALL_KEPT_SPEED


@kernel
def limit_speeds(state: NDArray[np.float64]) -> None:
    """Scale the robot's and the ball's velocities down to what a step may move them."""
    squared = state[STATE_VX] * state[STATE_VX] + state[STATE_VY] * state[STATE_VY]
    if squared > _MAX_SPEED * _MAX_SPEED:
        ratio = _MAX_SPEED / math.sqrt(squared)
        state[STATE_VX] *= ratio
        state[STATE_VY] *= ratio
    state[STATE_OMEGA] = min(max(state[STATE_OMEGA], -_MAX_OMEGA), _MAX_OMEGA)
    squared = (
        state[STATE_BALL_VX] * state[STATE_BALL_VX] + state[STATE_BALL_VY] * state[STATE_BALL_VY]
    )
    if squared > _MAX_SPEED * _MAX_SPEED:
        ratio = _MAX_SPEED / math.sqrt(squared)
        state[STATE_BALL_VX] *= ratio
        state[STATE_BALL_VY] *= ratio


@kernel
def move_robot(state: NDArray[np.float64], duration: float) -> None:
    """Move the robot at its velocities for ``duration`` seconds."""
    state[STATE_X] += duration * state[STATE_VX]
    state[STATE_Y] += duration * state[STATE_VY]
    turn_to(state, state[STATE_ANGLE] + duration * state[STATE_OMEGA])


@kernel
def turn_to(state: NDArray[np.float64], angle: float) -> None:
    """Set the robot's angle."""
    state[STATE_ANGLE] = angle
    state[STATE_COS] = math.cos(angle)
    state[STATE_SIN] = math.sin(angle)


@kernel
def move_ball(state: NDArray[np.float64]) -> None:
    """Move the ball at its velocity for one step."""
    state[STATE_BALL_X] += DT * state[STATE_BALL_VX]
    state[STATE_BALL_Y] += DT * state[STATE_BALL_VY]


@kernel
def grid_center(robot: NDArray[np.float64], state: NDArray[np.float64]) -> tuple[float, float]:
    """Position of the grid's centre, the pose that tasks and users see."""
    cos = state[STATE_COS]
    sin = state[STATE_SIN]
    x = state[STATE_X] - (cos * robot[ROBOT_CENTER_X] - sin * robot[ROBOT_CENTER_Y])
    y = state[STATE_Y] - (sin * robot[ROBOT_CENTER_X] + cos * robot[ROBOT_CENTER_Y])
    return x, y
