"""Free motion of robot and ball over one step: wheel forces, drag, limits, integration.

The order is Box2D's: forces from the velocities at the start of the step change the velocities;
contacts change them again (``contacts``); the limited velocities then move the bodies.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.layout import Robot, State, Wheel, World
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
def apply_wheels(world: World, state: State, action: NDArray[np.floating]) -> None:
    """Change the robot's velocities by the wheels' thrust and friction over one step.

    Args:
        world: The episode's world.
        state: The episode's state, whose velocities are changed.
        action: Gas per cell, shape ``(n * n,)``; clipped to [-1, 1].
    """
    cos = state.cos
    sin = state.sin
    u_x = cos * state.vx + sin * state.vy
    u_y = cos * state.vy - sin * state.vx
    omega = state.omega
    d = world.robot.damping
    change_x = -(d[0, 0] * u_x + d[0, 1] * u_y + d[0, 2] * omega)
    change_y = -(d[1, 0] * u_x + d[1, 1] * u_y + d[1, 2] * omega)
    change_omega = -(d[2, 0] * u_x + d[2, 1] * u_y + d[2, 2] * omega)
    for i in range(world.robot.wheel_count):
        wheel: Wheel = world.wheels[i]
        gas = min(max(float(action[wheel.place]), -1.0), 1.0)
        change_x += gas * wheel.vx
        change_y += gas * wheel.vy
        change_omega += gas * wheel.omega
    state.vx += cos * change_x - sin * change_y
    state.vy += sin * change_x + cos * change_y
    state.omega = omega + change_omega


@kernel
def apply_drag(state: State) -> None:
    """Change the ball's velocity by its drag over one step."""
    state.ball_vx *= _BALL_KEPT_SPEED
    state.ball_vy *= _BALL_KEPT_SPEED


@kernel
def limit_speeds(state: State) -> None:
    """Limit the robot's and the ball's velocities to the maximum move per step."""
    squared = state.vx * state.vx + state.vy * state.vy
    if squared > _MAX_SPEED * _MAX_SPEED:
        ratio = _MAX_SPEED / math.sqrt(squared)
        state.vx *= ratio
        state.vy *= ratio
    state.omega = min(max(state.omega, -_MAX_OMEGA), _MAX_OMEGA)
    squared = state.ball_vx * state.ball_vx + state.ball_vy * state.ball_vy
    if squared > _MAX_SPEED * _MAX_SPEED:
        ratio = _MAX_SPEED / math.sqrt(squared)
        state.ball_vx *= ratio
        state.ball_vy *= ratio


@kernel
def move_robot(state: State, duration: float) -> None:
    """Move the robot at its velocities for ``duration`` seconds."""
    state.x += duration * state.vx
    state.y += duration * state.vy
    turn_to(state, state.angle + duration * state.omega)


@kernel
def turn_to(state: State, angle: float) -> None:
    """Set the robot's angle."""
    state.angle = angle
    state.cos = math.cos(angle)
    state.sin = math.sin(angle)


@kernel
def move_ball(state: State) -> None:
    """Move the ball at its velocity for one step."""
    state.ball_x += DT * state.ball_vx
    state.ball_y += DT * state.ball_vy


@kernel
def grid_center(robot: Robot, state: State) -> tuple[float, float]:
    """Return the position of the grid's centre, which tasks and users see as the robot's."""
    cos = state.cos
    sin = state.sin
    x = state.x - (cos * robot.center_x - sin * robot.center_y)
    y = state.y - (sin * robot.center_x + cos * robot.center_y)
    return x, y
