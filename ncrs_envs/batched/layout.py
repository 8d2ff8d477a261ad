"""The records that the kernels read and write, each declared once.

All lengths are in units, times in seconds, angles in radians; world frame unless stated. Lists that
vary in length (a robot's wheels, a scenario's walls) lie in arrays beside the record that holds
the number of items in use, so that one compiled kernel serves all grid sizes.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.dtypes import Record, records

MAX_MEMORIES = 16
"""Maximum number of contact points whose impulses are kept from one step to the next."""
MAX_CORNERS = 4
_CONTACTS_PER_SIDE = 16
"""Capacity for contacts per cell of the grid's side: two points at each cell on four sides, twice
over because a cell can touch two pieces of wall."""


class Settings(Record):
    """Settings of a task, shared by all robots of a call."""

    extent: float
    """Half the playfield's side, P."""
    success_radius: float
    inverse_square: bool
    """True for the inverse-square distance score, False for the exponential one."""
    has_ball: bool


class Point(Record):
    """A position."""

    x: float
    y: float


class Memory(Record):
    """The impulses of one contact point in the step before."""

    key: int
    """See ``Contact.key``."""
    normal_impulse: float
    tangent_impulse: float


class State(Record):
    """State of one episode."""

    x: float
    """Centre of mass, not the grid's centre."""
    y: float
    angle: float
    vx: float
    vy: float
    omega: float
    cos: float
    """Cosine and sine of the angle, which sensing and the next step both need."""
    sin: float
    ball_x: float
    ball_y: float
    ball_vx: float
    ball_vy: float
    ball_omega: float
    clearance: float
    """Lower bound on the robot's distance from the light and the walls."""
    closest_goal: float
    """Minimum distance so far from the robot to the light or ball."""
    closest_target: float
    """Minimum distance so far from the ball to the target; 0 in tasks without a ball."""
    success: bool
    """True if the episode has ever succeeded."""
    crossed: bool
    """True if the grid's centre has ever been above y = 0."""
    touched: bool
    """True if the robot touched the light, the ball or a wall in the last step."""
    contact_count: int
    """Number of the world's contacts at the last solve of the last step; 0 if there was none."""
    memory_count: int
    memories: Annotated[NDArray[Memory], MAX_MEMORIES]


class Robot(Record):
    """Constants of one robot; positions in the body frame relative to the centre of mass."""

    inverse_mass: float
    inverse_inertia: float
    center_x: float
    """Centre of mass relative to the grid's centre, body frame."""
    center_y: float
    radius: float
    """Radius of a circle about the centre of mass that contains every cell."""
    damping: Annotated[NDArray[np.float64], (3, 3)]
    """Twist change per unit of twist in one step, body frame."""
    wheel_count: int
    sensor_count: int
    exposed_count: int
    """Number of cells with a free side."""


class Wheel(Record):
    """One wheel: its cell, and the twist change per unit of gas in one step, body frame."""

    place: int
    """Flat grid index."""
    vx: float
    vy: float
    omega: float


class Sensor(Record):
    """One sensor: its cell and its position, as in ``Robot``."""

    place: int
    """Flat grid index."""
    senses_target: bool
    senses_touch: bool
    exposed: int
    """Index among the exposed cells; -1 for a cell without a free side."""
    x: float
    y: float


class Robots(NamedTuple):
    """Many robots on grids of n x n cells; the first axis of every array is the robots."""

    robots: NDArray[Robot]
    wheels: NDArray[Wheel]
    """``(robots, n * n)``, as are the arrays below."""
    sensors: NDArray[Sensor]
    exposed: NDArray[Point]
    """Centres of the exposed cells."""


class Edge(Record):
    """An edge of a quad: its outward unit normal, and that times a point on the edge.

    The normal is zero where the edge's two corners coincide.
    """

    n_x: float
    n_y: float
    offset: float


class Quad(Record):
    """The convex hull of a piece of wall, with its bounding box."""

    low_x: float
    high_x: float
    low_y: float
    high_y: float
    corner_count: int
    """3 or 4."""
    corners: Annotated[NDArray[Point], MAX_CORNERS]
    """Counter-clockwise."""
    edges: Annotated[NDArray[Edge], MAX_CORNERS]
    """From each corner to the next."""


class Scenario(Record):
    """Placements of one episode."""

    start_x: float
    start_y: float
    goal_x: float
    """The light, or the ball's start."""
    goal_y: float
    target_x: float
    """NaN in tasks without a target."""
    target_y: float
    quad_count: int


class Scenarios(NamedTuple):
    """Many scenarios; the first axis of both arrays is the scenarios."""

    scenarios: NDArray[Scenario]
    quads: NDArray[Quad]
    """``(scenarios, capacity)``, each row in order of increasing lower edge."""


class Contact(Record):
    """A contact point.

    The reference face and the point belong to different shapes; "own" is the robot's frame about
    its centre of mass. The fields from ``normal_x`` on are the impulse solver's.
    """

    kind: int
    """``manifolds.FACE_OF_WALL``, ``FACE_OF_ROBOT`` or ``FACE_TO_BALL``."""
    key: int
    """Identifies the cell, the other shape and the edges and corners in contact."""
    face_nx: float
    """Normal of the reference face, outward: world frame for a wall's, own frame for a cell's."""
    face_ny: float
    face_x: float
    """A point on the reference face, in the same frame."""
    face_y: float
    point_x: float
    """The point of the other shape: own frame for a wall's face, world frame for a cell's."""
    point_y: float
    radii: float
    """Sum of the skins or radius that keep the point away from the face."""
    face_radius: float
    """Part of ``radii`` that belongs to the face's shape."""
    normal_x: float
    """Normal in the world frame at the start of the solve, towards the robot."""
    normal_y: float
    arm_x: float
    """From the centre of mass to the point, world frame, at the start of the solve."""
    arm_y: float
    ball_arm_x: float
    ball_arm_y: float
    normal_mass: float
    tangent_mass: float
    normal_impulse: float
    tangent_impulse: float


class Scratch(NamedTuple):
    """Buffers of the contact solver; their contents are meaningless between steps."""

    contacts: NDArray[Contact]
    corners: NDArray[Point]
    """Corners of one quad relative to a cell."""


class World(NamedTuple):
    """Inputs of one episode's steps, with the buffers that they need."""

    settings: Settings
    robot: Robot
    wheels: NDArray[Wheel]
    sensors: NDArray[Sensor]
    exposed: NDArray[Point]
    scenario: Scenario
    quads: NDArray[Quad]
    contacts: NDArray[Contact]
    corners: NDArray[Point]


class Worlds(NamedTuple):
    """Records from which ``simulate.make_world`` makes the worlds of many episodes."""

    settings: Settings
    robots: Robots
    scenarios: Scenarios
    scratch: Scratch


def make_robots(count: int, grid_size: int) -> Robots:
    """Return blank records of many robots."""
    places = grid_size * grid_size
    return Robots(
        records(Robot, count),
        records(Wheel, count, places),
        records(Sensor, count, places),
        records(Point, count, places),
    )


def make_scenarios(count: int, quads: int) -> Scenarios:
    """Return blank records of many scenarios, with room for ``quads`` quads each."""
    return Scenarios(records(Scenario, count), records(Quad, count, quads))


def make_scratch(grid_size: int) -> Scratch:
    """Return the contact solver's buffers for one robot; threads must not share them."""
    return Scratch(records(Contact, _CONTACTS_PER_SIDE * grid_size), records(Point, MAX_CORNERS))
