"""Contact points between a robot's cells and the light, the ball or the walls.

Contacts are those of Box2D: each pair of a cell and a convex piece has a manifold of at most two
points, found by clipping the edge that faces the reference face. Shapes have a thin skin, so that
their cores stay apart.
"""

from __future__ import annotations

from typing import NamedTuple

from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.geometry import (
    CELL_FACES,
    HALF_CELL,
    Frame,
    edge_of_quad,
    face_of_cell,
    quad_to_cell_frame,
    separation_along_cell,
    separation_along_quad,
    separation_from_point,
)
from ncrs_envs.batched.layout import MAX_MEMORIES, Contact, Edge, Memory, Point, Quad, State, World
from ncrs_envs.physics import BALL_RADIUS, LIGHT_RADIUS, MAX_TRANSLATION

LINEAR_SLOP = 0.005
"""Overlap of skins that is not corrected (Box2D)."""
SKIN = 2.0 * LINEAR_SLOP
"""Thickness of a polygon's skin (Box2D); a circle has none."""
# To be the reference face, a cell's face must separate by this much more than a quad's edge.
_FACE_PREFERENCE = 0.1 * LINEAR_SLOP
_HALF_DIAGONAL = HALF_CELL * 2.0**0.5

FACE_OF_WALL = 0
FACE_OF_ROBOT = 1
FACE_TO_BALL = 2

_FEATURES = 64
"""Number of ways in which a cell and a quad can touch: pairs of edges and corners."""


class Circle(NamedTuple):
    """The light or the ball, and the kind of its contacts."""

    kind: int
    x: float
    y: float
    own_x: float
    """Centre in the robot's own frame."""
    own_y: float
    radius: float


@kernel
def distance_from_quad(quad: Quad, x: float, y: float) -> float:
    """Return a lower bound on the distance of a point from a quad; negative inside.

    It is the maximum distance from a side of the quad or of its bounding box.
    """
    bound = max(max(quad.low_y - y, y - quad.high_y), max(quad.low_x - x, x - quad.high_x))
    for i in range(quad.corner_count):
        edge: Edge = quad.edges[i]
        if edge.n_x != 0.0 or edge.n_y != 0.0:
            bound = max(bound, edge.n_x * x + edge.n_y * y - edge.offset)
    return bound


@kernel
def near_quads(world: World, state: State) -> tuple[int, int]:
    """Return the first index and the end of the quads that the robot can reach in this step."""
    reach = world.robot.radius + 2.0 * MAX_TRANSLATION
    first = world.scenario.quad_count
    end = 0
    for i in range(world.scenario.quad_count):
        quad: Quad = world.quads[i]
        if quad.low_y > state.y + reach:
            break
        if distance_from_quad(quad, state.x, state.y) <= reach:
            first = min(first, i)
            end = i + 1
    return first, end


@kernel
def find_contacts(world: World, near: tuple[int, int], state: State) -> int:
    """Write the contact points of the current poses into the world's contacts.

    Args:
        world: The episode's world.
        near: First index and end of the quads to check, from ``near_quads``.
        state: The episode's state.

    Returns:
        Number of contact points.
    """
    exposed = world.robot.exposed_count
    count = 0
    circle = circle_of(world, state)
    if is_circle_near(world, state, circle):
        for i in range(exposed):
            count = touch_circle(world.contacts, count, circle, world.exposed[i], i)
    for thing in range(near[0], near[1]):
        if is_quad_near(world, state, thing):
            for i in range(exposed):
                frame = cell_frame(state, world.exposed[i])
                if is_cell_near(world.quads[thing], frame):
                    count = touch_quad(world, thing, i, frame, count)
    recall_impulses(state, world.contacts[:count])
    return count


@kernel
def is_circle_near(world: World, state: State, circle: Circle) -> bool:
    """Return True if the robot may touch the light or the ball at its present pose."""
    reach = world.robot.radius + circle.radius + SKIN
    from_x = circle.x - state.x
    from_y = circle.y - state.y
    return bool(from_x * from_x + from_y * from_y <= reach * reach)


@kernel
def is_quad_near(world: World, state: State, thing: int) -> bool:
    """Return True if the robot may touch a quad at its present pose."""
    reach = world.robot.radius + 2.0 * SKIN
    return bool(distance_from_quad(world.quads[thing], state.x, state.y) <= reach)


@kernel
def cell_frame(state: State, cell: Point) -> Frame:
    """Return the frame of a cell at the robot's present pose."""
    x = state.x + state.cos * cell.x - state.sin * cell.y
    y = state.y + state.sin * cell.x + state.cos * cell.y
    return Frame(x, y, state.cos, state.sin)


@kernel
def is_cell_near(quad: Quad, frame: Frame) -> bool:
    """Return True if a cell may touch a quad."""
    return bool(distance_from_quad(quad, frame.x, frame.y) <= _HALF_DIAGONAL + 2.0 * SKIN)


@kernel
def touch_quad(world: World, thing: int, cell: int, frame: Frame, count: int) -> int:
    """Add the contact points of an exposed cell with a quad, and return the new number of points.

    Args:
        world: The episode's world.
        thing: Index of the quad.
        cell: Index of the exposed cell.
        frame: The cell's frame.
        count: Number of contact points so far.
    """
    end = _touch_quad(world, count, world.quads[thing], world.exposed[cell], frame)
    for added in range(count, end):
        world.contacts[added].key += _FEATURES * ((thing + 1) * world.robot.exposed_count + cell)
    return end


@kernel
def touches_wall(world: World, count: int, cell: int) -> bool:
    """Return True if an exposed cell has one of the first ``count`` contact points, with a wall."""
    exposed = world.robot.exposed_count
    for i in range(count):
        thing_and_cell = world.contacts[i].key // _FEATURES
        if thing_and_cell >= exposed and thing_and_cell % exposed == cell:
            return True
    return False


@kernel
def circle_of(world: World, state: State) -> Circle:
    """Return the light, or the ball at its present place."""
    has_ball = world.settings.has_ball
    x = state.ball_x if has_ball else world.scenario.goal_x
    y = state.ball_y if has_ball else world.scenario.goal_y
    from_x = x - state.x
    from_y = y - state.y
    own_x = state.cos * from_x + state.sin * from_y
    own_y = state.cos * from_y - state.sin * from_x
    kind = FACE_TO_BALL if has_ball else FACE_OF_ROBOT
    return Circle(kind, x, y, own_x, own_y, BALL_RADIUS if has_ball else LIGHT_RADIUS)


@kernel
def recall_impulses(state: State, contacts: NDArray[Contact]) -> None:
    """Set each contact point's impulses to those of the step before, or to 0."""
    for i in range(len(contacts)):
        contact: Contact = contacts[i]
        contact.normal_impulse = 0.0
        contact.tangent_impulse = 0.0
        for j in range(state.memory_count):
            memory: Memory = state.memories[j]
            if memory.key == contact.key:
                contact.normal_impulse = memory.normal_impulse
                contact.tangent_impulse = memory.tangent_impulse


@kernel
def copy_contact(source: Contact, target: Contact) -> None:
    """Copy what was found of a contact point; the solver's half is not copied."""
    target.kind = source.kind
    target.key = source.key
    target.face_nx = source.face_nx
    target.face_ny = source.face_ny
    target.face_x = source.face_x
    target.face_y = source.face_y
    target.point_x = source.point_x
    target.point_y = source.point_y
    target.radii = source.radii
    target.face_radius = source.face_radius


@kernel
def keep_impulses(state: State, contacts: NDArray[Contact]) -> None:
    """Keep the impulses of contact points for the next step."""
    state.memory_count = min(len(contacts), MAX_MEMORIES)
    for i in range(state.memory_count):
        contact: Contact = contacts[i]
        memory: Memory = state.memories[i]
        memory.key = contact.key
        memory.normal_impulse = contact.normal_impulse
        memory.tangent_impulse = contact.tangent_impulse


@kernel
def touch_circle(
    contacts: NDArray[Contact], count: int, circle: Circle, cell: Point, index: int
) -> int:
    """Add the contact of a cell with a circle, if any, and return the new number of points.

    Args:
        contacts: Output.
        count: Number of contact points so far.
        circle: The circle.
        cell: Centre of the exposed cell.
        index: Index of the exposed cell.
    """
    x = circle.own_x - cell.x
    y = circle.own_y - cell.y
    distance, n_x, n_y = separation_from_point(x, y)
    if distance > circle.radius + SKIN or count == len(contacts):
        return count
    contact: Contact = contacts[count]
    contact.kind = circle.kind
    contact.key = _FEATURES * index
    contact.face_nx = -n_x
    contact.face_ny = -n_y
    contact.face_x = circle.own_x + distance * n_x
    contact.face_y = circle.own_y + distance * n_y
    contact.point_x = circle.x
    contact.point_y = circle.y
    contact.radii = circle.radius + SKIN
    contact.face_radius = SKIN
    return count + 1


@kernel
def _touch_quad(world: World, count: int, quad: Quad, cell: Point, frame: Frame) -> int:
    """Add the contact points of a cell with a quad, if any, and return the new number of points."""
    x, y, cos, sin = frame
    by_quad, quad_nx, quad_ny, edge = separation_along_quad(quad, frame)
    if by_quad > 2.0 * SKIN:
        return count
    corners = world.corners[: quad_to_cell_frame(quad, frame, world.corners)]
    by_cell, cell_nx, cell_ny, face = separation_along_cell(corners)
    if by_cell > 2.0 * SKIN:
        return count
    if by_cell > by_quad + _FACE_PREFERENCE:
        n_x = -cell_nx
        n_y = -cell_ny
        # Ends of the face, counter-clockwise about the cell.
        f_x0 = HALF_CELL * (n_x + n_y)
        f_y0 = HALF_CELL * (n_y - n_x)
        f_x1 = HALF_CELL * (n_x - n_y)
        f_y1 = HALF_CELL * (n_y + n_x)
        edge = face
        opposite = _facing_edge(quad, cos * n_x - sin * n_y, sin * n_x + cos * n_y)
        p_x0, p_y0, p_x1, p_y1 = edge_of_quad(corners, opposite)
        kind = FACE_OF_ROBOT
    else:
        n_x = quad_nx
        n_y = quad_ny
        f_x0, f_y0, f_x1, f_y1 = edge_of_quad(corners, edge)
        opposite = _facing_face(n_x, n_y)
        o_x, o_y = face_of_cell(opposite)
        p_x0 = HALF_CELL * (o_x + o_y)
        p_y0 = HALF_CELL * (o_y - o_x)
        p_x1 = HALF_CELL * (o_x - o_y)
        p_y1 = HALF_CELL * (o_y + o_x)
        kind = FACE_OF_WALL
    # Clip the facing edge to the reference face, whose tangent is its normal turned left.
    low = -n_y * f_x0 + n_x * f_y0 - 2.0 * SKIN
    high = -n_y * f_x1 + n_x * f_y1 + 2.0 * SKIN
    first = -n_y * p_x0 + n_x * p_y0
    second = -n_y * p_x1 + n_x * p_y1
    if max(first, second) < low or min(first, second) > high:
        return count
    for end in range(2):
        along = min(max(first if end == 0 else second, low), high)
        fraction = 0.0 if first == second else (along - first) / (second - first)
        if first == second and end == 1:
            fraction = 1.0
        p_x = p_x0 + fraction * (p_x1 - p_x0)
        p_y = p_y0 + fraction * (p_y1 - p_y0)
        if n_x * (p_x - f_x0) + n_y * (p_y - f_y0) > 2.0 * SKIN or count == len(world.contacts):
            continue
        contact: Contact = world.contacts[count]
        contact.kind = kind
        # A clipped point belongs to a corner of the reference face and the facing edge, any other
        # to the reference face and the edge's corner.
        clipped = along != (first if end == 0 else second)
        corner = opposite if clipped else (opposite + end) % 4
        contact.key = ((kind * 2 + clipped) * 4 + edge) * 4 + corner
        contact.radii = 2.0 * SKIN
        contact.face_radius = SKIN
        if kind == FACE_OF_WALL:
            contact.face_nx = cos * n_x - sin * n_y
            contact.face_ny = sin * n_x + cos * n_y
            contact.face_x = x + cos * f_x0 - sin * f_y0
            contact.face_y = y + sin * f_x0 + cos * f_y0
            contact.point_x = cell.x + p_x
            contact.point_y = cell.y + p_y
        else:
            contact.face_nx = n_x
            contact.face_ny = n_y
            contact.face_x = cell.x + f_x0
            contact.face_y = cell.y + f_y0
            contact.point_x = x + cos * p_x - sin * p_y
            contact.point_y = y + sin * p_x + cos * p_y
        count += 1
    return count


@kernel
def _facing_edge(quad: Quad, n_x: float, n_y: float) -> int:
    """Return the quad's edge whose outward normal is most opposed to a world direction."""
    best = 2.0
    best_edge = 0
    for i in range(quad.corner_count):
        edge: Edge = quad.edges[i]
        if edge.n_x == 0.0 and edge.n_y == 0.0:
            continue
        opposed = n_x * edge.n_x + n_y * edge.n_y
        if opposed < best:
            best = opposed
            best_edge = i
    return best_edge


@kernel
def _facing_face(n_x: float, n_y: float) -> int:
    """Return the cell's face whose outward normal is most opposed to a direction."""
    best = 2.0
    best_face = 0
    for face in range(CELL_FACES):
        f_x, f_y = face_of_cell(face)
        opposed = n_x * f_x + n_y * f_y
        if opposed < best:
            best = opposed
            best_face = face
    return best_face
