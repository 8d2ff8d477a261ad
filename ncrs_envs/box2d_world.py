"""One robot and its scenario as a Box2D world: build, step, read poses. No task rules here.

The robot is one rigid body with a square fixture per cell: in the jointed construction of the
published runs (``ncrs_envs.box2d_jointed``) every joint is locked, so that most bodies move in the
same way. Every episode gets a new world, since a reused one keeps its contact order and is not
deterministic. For the same reason a copy of a world is made by repeating its steps.
"""

from __future__ import annotations

import math
import threading
import warnings
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.body import CELL_SIZE, BodyGrid, Cell, cell_centers, cell_densities
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

with warnings.catch_warnings():
    # The binding crashes the process if a warning of its import is an error.
    warnings.simplefilter("ignore")
    import Box2D

VERSION: str = Box2D.__version__
_VELOCITY_ITERATIONS = 180
_POSITION_ITERATIONS = 60
_WALL = "wall"

Pose = tuple[float, float, float]


class _Definitions(threading.local):
    """One fixture definition for each kind of shape, used again and again; Box2D copies them.

    The binding loses 300 bytes for every shape that a definition was given.
    """

    def __init__(self) -> None:
        self._polygon, self._circle = Box2D.b2PolygonShape(), Box2D.b2CircleShape()
        given = {"friction": CONTACT_FRICTION, "restitution": CONTACT_RESTITUTION}
        self._of_polygon = Box2D.b2FixtureDef(shape=self._polygon, **given)
        self._of_circle = Box2D.b2FixtureDef(shape=self._circle, **given)
        self.static = Box2D.b2BodyDef(type=Box2D.b2_staticBody)
        """Definition of a body that stands still at the origin."""

    def polygon(self, vertices: Sequence[tuple[float, float]]) -> Box2D.b2FixtureDef:
        self._polygon.vertices = vertices
        self._of_polygon.density = 0.0
        return self._of_polygon

    def square(self, center: tuple[float, float], density: float) -> Box2D.b2FixtureDef:
        self._polygon.SetAsBox(CELL_SIZE / 2.0, CELL_SIZE / 2.0, center, 0.0)
        self._of_polygon.density = density
        return self._of_polygon

    def circle(
        self, center: tuple[float, float], radius: float, density: float
    ) -> Box2D.b2FixtureDef:
        self._circle.pos, self._circle.radius = center, radius
        self._of_circle.density = density
        return self._of_circle


DEFINITIONS = _Definitions()


class RobotWorld:
    """A Box2D world with one robot. Pickles and copies move on bit-identically.

    Args:
        body: Cell codes of a valid body, shape ``(n, n)``.
        wheels: Wheel model of the body, with the density of its hull.
        scenario: Placements that fit the task.
    """

    def __init__(self, body: BodyGrid, wheels: WheelModel, scenario: Scenario) -> None:
        self._made_of = (body, wheels, scenario)
        self._history: list[NDArray[np.float64] | tuple[BodyGrid, WheelModel]] = []
        self._body, self._wheels = body, wheels
        self._world = Box2D.b2World(gravity=(0.0, 0.0), doSleep=False)
        for quad in _solid_quads(scenario, body.shape[0]):
            self._add_static(DEFINITIONS.polygon(quad), _WALL)
        if scenario.light is not None:
            self._add_static(DEFINITIONS.circle(scenario.light, LIGHT_RADIUS, 0.0))
        self._ball = None
        if scenario.ball is not None:
            ball = DEFINITIONS.circle((0.0, 0.0), BALL_RADIUS, BALL_DENSITY)
            self._ball = self._world.CreateDynamicBody(position=scenario.ball, fixtures=ball)
        self._robot = self._world.CreateDynamicBody(position=scenario.start)
        self._fixtures: dict[tuple[int, int], Any] = {}
        self._add_cells(body != Cell.EMPTY)

    def _add_cells(self, added: NDArray[np.bool_]) -> None:
        """Add cells, a mask ``(n, n)``, to the robot."""
        centers = cell_centers(len(self._body))
        densities = cell_densities(self._wheels.hull_density)
        for row, column in np.argwhere(added).tolist():
            x, y = centers[row, column].tolist()
            density = float(densities[self._body[row, column]])
            fixture = self._robot.CreateFixture(DEFINITIONS.square((x, y), density))
            fixture.userData = row * len(self._body) + column
            self._fixtures[row, column] = fixture

    def _add_static(self, fixture: Box2D.b2FixtureDef, name: str | None = None) -> None:
        body = self._world.CreateBody(DEFINITIONS.static)
        body.CreateFixture(fixture)
        body.userData = name

    def __reduce__(self) -> tuple[Any, ...]:
        """Describe the world by its parts, the gas of its steps, and its other bodies."""
        return _repeat, (type(self), *self._made_of, self._history)

    def exchange(self, body: BodyGrid, wheels: WheelModel) -> None:
        """Continue with another body on the same grid, which keeps its place and its motion.

        Args:
            body: Cell codes of a body that is not empty, shape ``(n, n)``.
            wheels: Wheel model of the body.
        """
        self._history.append((body, wheels))
        before, self._body, self._wheels = self._body, body, wheels
        changed = before != body
        gone = {place: self._fixtures[place] for place in self._fixtures if changed[place]}
        # New cells come first: a body without any cells would get a mass of its own.
        self._add_cells(changed & (body != Cell.EMPTY))
        for place, fixture in gone.items():
            self._robot.DestroyFixture(fixture)
            if self._fixtures[place] is fixture:
                del self._fixtures[place]

    def step(self, gas: NDArray[np.float64]) -> None:
        """Advance one physics step of ``DT`` seconds.

        Args:
            gas: One value in [-1, 1] per wheel in row order, shape ``(wheels,)``; kept, and not to
                be changed afterwards.
        """
        self._history.append(gas)
        self._push(gas)
        if self._ball is not None:
            velocity = self._ball.linearVelocity
            drag = (-BALL_DRAG * velocity.x, -BALL_DRAG * velocity.y)
            self._ball.ApplyForceToCenter(drag, True)
        self._world.Step(DT, _VELOCITY_ITERATIONS, _POSITION_ITERATIONS)

    def _push(self, gas: NDArray[np.float64]) -> None:
        """Apply the forces of the wheels over the next step."""
        robot = self._robot
        angle, velocity = robot.angle, robot.linearVelocity
        cos, sin = math.cos(angle), math.sin(angle)
        v_x, v_y = velocity.x, velocity.y  # unpacking Box2D's vectors is slow
        twist = (cos * v_x + sin * v_y, cos * v_y - sin * v_x, robot.angularVelocity)
        f_x, f_y, torque = self._wheels.wrench(gas, twist)
        robot.ApplyForceToCenter((cos * f_x - sin * f_y, sin * f_x + cos * f_y), True)
        robot.ApplyTorque(torque, True)

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

    @property
    def cells_at_walls(self) -> set[int]:
        """Flat grid indices of the cells that touch a wall after the last step."""
        touching = (edge.contact for edge in self._robot.contacts if edge.other.userData == _WALL)
        fixtures = (
            (contact.fixtureA, contact.fixtureB) for contact in touching if contact.touching
        )
        return {
            fixture.userData for pair in fixtures for fixture in pair if fixture.body == self._robot
        }


def _repeat(
    kind: type[RobotWorld],
    body: BodyGrid,
    wheels: WheelModel,
    scenario: Scenario,
    history: Sequence[NDArray[np.float64] | tuple[BodyGrid, WheelModel]],
) -> RobotWorld:
    """Build a world and repeat its steps."""
    world = kind(body, wheels, scenario)
    for event in history:
        if isinstance(event, tuple):
            world.exchange(*event)
        else:
            world.step(event)
    return world


def _solid_quads(scenario: Scenario, grid_size: int) -> Iterator[list[tuple[float, float]]]:
    """Yield the wall quads that Box2D accepts, leaving out flat ones.

    Box2D merges vertices that nearly coincide, and needs at least three.
    """
    quads = wall_quads(scenario, grid_size)
    sides = quads.max(axis=1) - quads.min(axis=1)
    for quad in quads[(sides > MIN_QUAD_SIDE).all(axis=1)].tolist():
        yield [(x, y) for x, y in quad]
