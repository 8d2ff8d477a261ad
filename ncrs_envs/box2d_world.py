"""One robot and its scenario as a Box2D world: build, step, read poses. No task rules here.

The robot is one rigid body with a square fixture per cell: in the jointed construction of the
published runs every joint is locked, so the motion is the same. Every episode gets a new world,
since a reused one keeps its contact order and is not deterministic.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import Box2D
import numpy as np
from numpy.typing import NDArray

from ncrs_envs.body import CELL_DENSITY, CELL_SIZE, BodyGrid, Cell, cell_centers
from ncrs_envs.physics import (
    BALL_DENSITY,
    BALL_DRAG,
    BALL_RADIUS,
    CONTACT_FRICTION,
    CONTACT_RESTITUTION,
    DT,
    LIGHT_RADIUS,
    WheelModel,
)
from ncrs_envs.scenario import MIN_QUAD_SIDE, Scenario, wall_quads

_VELOCITY_ITERATIONS = 180
_POSITION_ITERATIONS = 60

Pose = tuple[float, float, float]


class RobotWorld:
    """A Box2D world with one robot.

    Args:
        body: Cell codes of a valid body, shape ``(n, n)``.
        wheels: Wheel model of the body.
        scenario: Placements that fit the task.
    """

    def __init__(self, body: BodyGrid, wheels: WheelModel, scenario: Scenario) -> None:
        self._wheels = wheels
        self._world = Box2D.b2World(gravity=(0.0, 0.0), doSleep=False)
        for quad in _solid_quads(scenario, body.shape[0]):
            self._add_static(Box2D.b2PolygonShape(vertices=quad))
        if scenario.light is not None:
            self._add_static(Box2D.b2CircleShape(pos=scenario.light, radius=LIGHT_RADIUS))
        self._ball = None
        if scenario.ball is not None:
            shape = Box2D.b2CircleShape(radius=BALL_RADIUS)
            self._ball = self._world.CreateDynamicBody(
                position=scenario.ball, fixtures=_fixture(shape, BALL_DENSITY)
            )
        half = CELL_SIZE / 2.0
        centers = cell_centers(body.shape[0])
        self._robot = self._world.CreateDynamicBody(
            position=scenario.start,
            fixtures=[
                _fixture(
                    Box2D.b2PolygonShape(box=(half, half, tuple(centers[row, column]), 0.0)),
                    CELL_DENSITY[Cell(int(body[row, column]))],
                )
                for row, column in np.argwhere(body != Cell.EMPTY)
            ],
        )

    def _add_static(self, shape: Box2D.b2Shape) -> None:
        self._world.CreateStaticBody(fixtures=_fixture(shape, 0.0))

    def step(self, gas: NDArray[np.float64]) -> None:
        """Advance one physics step of ``DT`` seconds.

        Args:
            gas: One value in [-1, 1] per wheel in row order, shape ``(wheels,)``.
        """
        robot = self._robot
        angle, velocity = robot.angle, robot.linearVelocity
        cos, sin = math.cos(angle), math.sin(angle)
        v_x, v_y = velocity.x, velocity.y  # unpacking Box2D's vectors is slow
        twist = np.array([cos * v_x + sin * v_y, cos * v_y - sin * v_x, robot.angularVelocity])
        f_x, f_y, torque = self._wheels.wrench(gas, twist).tolist()
        robot.ApplyForceToCenter((cos * f_x - sin * f_y, sin * f_x + cos * f_y), True)
        robot.ApplyTorque(torque, True)
        if self._ball is not None:
            velocity = self._ball.linearVelocity
            drag = (-BALL_DRAG * velocity.x, -BALL_DRAG * velocity.y)
            self._ball.ApplyForceToCenter(drag, True)
        self._world.Step(DT, _VELOCITY_ITERATIONS, _POSITION_ITERATIONS)

    @property
    def pose(self) -> Pose:
        """Robot centre x and y in world units, and heading angle in radians (0 is +y)."""
        position = self._robot.position
        return (position.x, position.y, self._robot.angle)

    @property
    def twist(self) -> Pose:
        """World-frame velocity of the centre of mass (units/s) and angular velocity (rad/s)."""
        v_x, v_y = self._robot.linearVelocity
        return (v_x, v_y, self._robot.angularVelocity)

    @property
    def ball(self) -> tuple[float, float] | None:
        """Ball centre in world units; None in worlds without a ball."""
        if self._ball is None:
            return None
        position = self._ball.position
        return (position.x, position.y)

    @property
    def touching(self) -> bool:
        """True if the robot touches the light, the ball or a wall after the last step."""
        return any(edge.contact.touching for edge in self._robot.contacts)


def _fixture(shape: Box2D.b2Shape, density: float) -> Box2D.b2FixtureDef:
    return Box2D.b2FixtureDef(
        shape=shape,
        density=density,
        friction=CONTACT_FRICTION,
        restitution=CONTACT_RESTITUTION,
    )


def _solid_quads(scenario: Scenario, grid_size: int) -> Iterator[list[tuple[float, float]]]:
    """Yield the wall quads that Box2D accepts, leaving out flat ones.

    Box2D merges vertices that nearly coincide, and needs at least three.
    """
    for quad in wall_quads(scenario, grid_size):
        height, width = np.ptp(quad[:, 1]), np.ptp(quad[:, 0])
        if min(height, width) > MIN_QUAD_SIDE:
            yield [(float(x), float(y)) for x, y in quad]
