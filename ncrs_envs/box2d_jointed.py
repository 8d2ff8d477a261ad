"""The construction of the published code, for comparisons: a hull, and a body for each wheel.

All cells but the wheels form the hull. Every wheel is held by a revolute joint, locked at 0 by its
limits and by its motor. Most bodies move as one rigid body would. Where the hull is a cell or two,
the joints give: the robot wobbles, and runs faster than a wheel can, or stalls. Neighbouring wheels
touch each other, and the friction of the wheels is explicit, as published.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.body import BodyGrid, Cell, cell_centers, cell_densities
from ncrs_envs.box2d_world import DEFINITIONS, RobotWorld
from ncrs_envs.physics import (
    JOINT_TORQUE,
    WHEEL_FORWARD_FRICTION,
    WHEEL_SIDE_FRICTION,
    WHEEL_THRUST,
    WheelModel,
)
from ncrs_envs.scenario import Point, Scenario

_FORWARD, _SIDE = (0.0, 1.0), (1.0, 0.0)
"""Axes of a wheel, in its own frame."""


class JointedWorld(RobotWorld):
    """A Box2D world with one jointed robot, whose pose and twist are the hull's.

    Args:
        body: Cell codes of a valid body, shape ``(n, n)``.
        wheels: Wheel model of the body, with the density of its hull.
        scenario: Placements that fit the task.
    """

    def __init__(self, body: BodyGrid, wheels: WheelModel, scenario: Scenario) -> None:
        super().__init__(body, wheels, scenario)
        centers = cell_centers(len(body)).reshape(-1, 2)[wheels.wheel_cells].tolist()
        self._wheel_bodies = [self._add_wheel(scenario.start, (x, y)) for x, y in centers]

    def _add_cells(self, added: NDArray[np.bool_]) -> None:
        super()._add_cells(added & (self._body != Cell.WHEEL))

    def _add_wheel(self, start: Point, center: Point) -> Any:
        position = (start[0] + center[0], start[1] + center[1])
        wheel = self._world.CreateDynamicBody(position=position)
        wheel.CreateFixture(DEFINITIONS.square((0.0, 0.0), float(cell_densities()[Cell.WHEEL])))
        self._world.CreateRevoluteJoint(
            bodyA=self._robot,
            bodyB=wheel,
            localAnchorA=center,
            localAnchorB=(0.0, 0.0),
            enableLimit=True,
            lowerAngle=0.0,
            upperAngle=0.0,
            enableMotor=True,
            motorSpeed=0.0,
            maxMotorTorque=JOINT_TORQUE,
        )
        return wheel

    def _push(self, gas: NDArray[np.float64]) -> None:
        for wheel, own_gas in zip(self._wheel_bodies, gas.tolist(), strict=True):
            forward, side = wheel.GetWorldVector(_FORWARD), wheel.GetWorldVector(_SIDE)
            velocity = wheel.linearVelocity
            ahead = forward.x * velocity.x + forward.y * velocity.y
            aside = side.x * velocity.x + side.y * velocity.y
            thrust = WHEEL_THRUST * own_gas - WHEEL_FORWARD_FRICTION * ahead
            grip = -WHEEL_SIDE_FRICTION * aside
            force = (thrust * forward.x + grip * side.x, thrust * forward.y + grip * side.y)
            wheel.ApplyForceToCenter(force, True)

    @property
    def touching(self) -> bool:
        """True if the robot touches the light, the ball or a wall after the last step."""
        own = [self._robot, *self._wheel_bodies]
        return any(
            edge.contact.touching and edge.other not in own
            for body in own
            for edge in body.contacts
        )
