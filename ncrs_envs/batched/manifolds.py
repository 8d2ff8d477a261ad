"""Contact points between a robot's cells and the light, the ball or the walls.

Contacts are those of Box2D: each pair of a cell and a convex piece has a manifold of at most two
points, found by clipping the edge that faces the reference face. Shapes have a thin skin, so that
their cores stay apart.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.geometry import (
    CELL_FACES,
    HALF_CELL,
    edge_of_quad,
    face_of_cell,
    quad_to_cell_frame,
    separation_along_cell,
    separation_along_quad,
    separation_from_point,
)
from ncrs_envs.batched.layout import (
    CELLS_EXPOSED,
    CELLS_GRID_SIZE,
    MEMORIES,
    MEMORY_KEY,
    MEMORY_NORMAL,
    MEMORY_SIZE,
    MEMORY_TANGENT,
    QUAD_CORNERS,
    QUAD_EDGES,
    QUAD_HIGH_X,
    QUAD_HIGH_Y,
    QUAD_LOW_X,
    QUAD_LOW_Y,
    QUAD_SIZE,
    ROBOT_HEADER,
    ROBOT_RADIUS,
    SCENARIO_HEADER,
    SCENARIO_QUADS,
    SCENARIO_SEEN_X,
    SCENARIO_SEEN_Y,
    SETTING_HAS_BALL,
    STATE_BALL_X,
    STATE_BALL_Y,
    STATE_COS,
    STATE_MEMORIES,
    STATE_MEMORY,
    STATE_SIN,
    STATE_X,
    STATE_Y,
)
from ncrs_envs.physics import BALL_RADIUS, LIGHT_RADIUS, MAX_TRANSLATION

LINEAR_SLOP = 0.005
"""Overlap of skins that is left standing (Box2D)."""
SKIN = 2.0 * LINEAR_SLOP
"""Thickness of a polygon's skin (Box2D); a circle has none."""
# A cell's face must separate better than a quad's edge by this much to be the reference face.
_FACE_PREFERENCE = 0.1 * LINEAR_SLOP
_HALF_DIAGONAL = HALF_CELL * 2.0**0.5

# A contact point in the scratch array. The reference face and the point belong to different
# things; "own" is the frame of the robot about its centre of mass.
KIND = 0
"""FACE_OF_WALL, FACE_OF_ROBOT or FACE_TO_BALL."""
FACE_NX = 1
"""Normal of the reference face, outward: world frame for a wall's, own frame for a cell's."""
FACE_NY = 2
FACE_X = 3
"""A point on the reference face, in the same frame."""
FACE_Y = 4
POINT_X = 5
"""The point of the other shape: own frame for a wall's face, world frame for a cell's."""
POINT_Y = 6
RADII = 7
"""Skins or radius that keep the point away from the face."""
FACE_RADIUS = 8
"""That part of the radii that belongs to the face's shape."""
NORMAL_X = 9
"""Normal in the world frame at the start of the solve, towards the robot."""
NORMAL_Y = 10
ARM_X = 11
"""From the centre of mass to the point, world frame, at the start of the solve."""
ARM_Y = 12
BALL_ARM_X = 13
BALL_ARM_Y = 14
NORMAL_MASS = 15
TANGENT_MASS = 16
NORMAL_IMPULSE = 17
TANGENT_IMPULSE = 18
KEY = 19
"""Which cell touches what with which feature; features are numbered in ``_touch_quad``."""
CONTACT_SIZE = 20

FACE_OF_WALL = 0.0
FACE_OF_ROBOT = 1.0
FACE_TO_BALL = 2.0

FEATURES = 64
"""Number of ways in which a cell and a quad can touch: pairs of edges and corners."""
FIRST_CONTACT = 8
"""The scratch array begins with room for the corners of one quad."""


def scratch_size(grid_size: int) -> int:
    """Length of the scratch array: room for two points at each of a face's cells on four sides,
    twice over, since a cell can touch two pieces of wall."""
    return FIRST_CONTACT + CONTACT_SIZE * 16 * grid_size


@kernel
def contact_at(index: int) -> int:
    """Where contact point ``index`` begins in the scratch array."""
    return FIRST_CONTACT + CONTACT_SIZE * index


@kernel
def _has_room(scratch: NDArray[np.float64], count: int) -> bool:
    return bool(contact_at(count + 1) <= scratch.shape[0])


@kernel
def distance_from_quad(scenario: NDArray[np.float64], quad: int, x: float, y: float) -> float:
    """A lower bound on the distance of a point from a quad, from the sides of the quad and of its
    bounding box; negative inside."""
    most = max(
        max(scenario[quad + QUAD_LOW_Y] - y, y - scenario[quad + QUAD_HIGH_Y]),
        max(scenario[quad + QUAD_LOW_X] - x, x - scenario[quad + QUAD_HIGH_X]),
    )
    for corner in range(int(scenario[quad + QUAD_CORNERS])):
        edge = quad + QUAD_EDGES + 3 * corner
        outward = scenario[edge] * x + scenario[edge + 1] * y - scenario[edge + 2]
        if scenario[edge] != 0.0 or scenario[edge + 1] != 0.0:
            most = max(most, outward)
    return float(most)


@kernel
def near_quads(
    robot: NDArray[np.float64], scenario: NDArray[np.float64], state: NDArray[np.float64]
) -> tuple[int, int]:
    """First index and end of the quads that the robot can touch in this step, however it moves."""
    reach = robot[ROBOT_RADIUS] + 2.0 * MAX_TRANSLATION
    quads = int(scenario[SCENARIO_QUADS])
    first = quads
    end = 0
    for i in range(quads):
        quad = SCENARIO_HEADER + QUAD_SIZE * i
        if scenario[quad + QUAD_LOW_Y] > state[STATE_Y] + reach:
            break
        if distance_from_quad(scenario, quad, state[STATE_X], state[STATE_Y]) <= reach:
            first = min(first, i)
            end = i + 1
    return first, end


@kernel
def find_contacts(
    settings: NDArray[np.float64],
    robot: NDArray[np.float64],
    cells: NDArray[np.int32],
    scenario: NDArray[np.float64],
    near: tuple[int, int],
    state: NDArray[np.float64],
    scratch: NDArray[np.float64],
) -> int:
    """Write the contact points of the current poses into ``scratch`` and return their number.

    Args:
        settings: the task's settings.
        robot: the robot's record.
        cells: the robot's indices.
        scenario: the run's scenario.
        near: which quads to look at, from ``near_quads``.
        state: the run's state.
        scratch: output.
    """
    has_ball = settings[SETTING_HAS_BALL] != 0.0
    circle_x = state[STATE_BALL_X] if has_ball else scenario[SCENARIO_SEEN_X]
    circle_y = state[STATE_BALL_Y] if has_ball else scenario[SCENARIO_SEEN_Y]
    radius = BALL_RADIUS if has_ball else LIGHT_RADIUS
    kind = FACE_TO_BALL if has_ball else FACE_OF_ROBOT
    cos = state[STATE_COS]
    sin = state[STATE_SIN]
    places = cells[CELLS_GRID_SIZE] * cells[CELLS_GRID_SIZE]
    start = ROBOT_HEADER + 5 * places
    exposed = cells[CELLS_EXPOSED]
    count = 0
    reach = robot[ROBOT_RADIUS] + radius + SKIN
    from_x = circle_x - state[STATE_X]
    from_y = circle_y - state[STATE_Y]
    if from_x * from_x + from_y * from_y <= reach * reach:
        own_x = cos * from_x + sin * from_y
        own_y = cos * from_y - sin * from_x
        for cell in range(exposed):
            before = count
            cell_x = robot[start + 2 * cell]
            cell_y = robot[start + 2 * cell + 1]
            count = _touch_circle(
                scratch, count, kind, cell_x, cell_y, own_x, own_y, circle_x, circle_y, radius
            )
            if count > before:
                scratch[contact_at(before) + KEY] = FEATURES * cell
    reach = robot[ROBOT_RADIUS] + 2.0 * SKIN
    for i in range(near[0], near[1]):
        quad = SCENARIO_HEADER + QUAD_SIZE * i
        if distance_from_quad(scenario, quad, state[STATE_X], state[STATE_Y]) > reach:
            continue
        for cell in range(exposed):
            cell_x = robot[start + 2 * cell]
            cell_y = robot[start + 2 * cell + 1]
            x = state[STATE_X] + cos * cell_x - sin * cell_y
            y = state[STATE_Y] + sin * cell_x + cos * cell_y
            if distance_from_quad(scenario, quad, x, y) <= _HALF_DIAGONAL + 2.0 * SKIN:
                before = count
                count = _touch_quad(scratch, count, scenario, quad, cell_x, cell_y, x, y, cos, sin)
                for added in range(before, count):
                    scratch[contact_at(added) + KEY] += FEATURES * ((i + 1) * exposed + cell)
    _remember(state, scratch, count)
    return count


@kernel
def _remember(state: NDArray[np.float64], scratch: NDArray[np.float64], count: int) -> None:
    """Start each contact point with the impulses that it had in the step before, or with 0."""
    for i in range(count):
        contact = contact_at(i)
        scratch[contact + NORMAL_IMPULSE] = 0.0
        scratch[contact + TANGENT_IMPULSE] = 0.0
        for j in range(int(state[STATE_MEMORY])):
            memory = STATE_MEMORIES + MEMORY_SIZE * j
            if state[memory + MEMORY_KEY] == scratch[contact + KEY]:
                scratch[contact + NORMAL_IMPULSE] = state[memory + MEMORY_NORMAL]
                scratch[contact + TANGENT_IMPULSE] = state[memory + MEMORY_TANGENT]


@kernel
def keep_impulses(state: NDArray[np.float64], scratch: NDArray[np.float64], count: int) -> None:
    """Keep the impulses of the contact points in ``scratch`` for the next step."""
    kept = min(count, MEMORIES)
    for i in range(kept):
        contact = contact_at(i)
        memory = STATE_MEMORIES + MEMORY_SIZE * i
        state[memory + MEMORY_KEY] = scratch[contact + KEY]
        state[memory + MEMORY_NORMAL] = scratch[contact + NORMAL_IMPULSE]
        state[memory + MEMORY_TANGENT] = scratch[contact + TANGENT_IMPULSE]
    state[STATE_MEMORY] = kept


@kernel
def _touch_circle(
    scratch: NDArray[np.float64],
    count: int,
    kind: float,
    cell_x: float,
    cell_y: float,
    own_x: float,
    own_y: float,
    world_x: float,
    world_y: float,
    radius: float,
) -> int:
    """Add the contact of a cell with a circle, if any, and return the new number of points."""
    x = own_x - cell_x
    y = own_y - cell_y
    distance, n_x, n_y = separation_from_point(x, y)
    if distance > radius + SKIN or not _has_room(scratch, count):
        return count
    contact = contact_at(count)
    scratch[contact + KIND] = kind
    scratch[contact + FACE_NX] = -n_x
    scratch[contact + FACE_NY] = -n_y
    scratch[contact + FACE_X] = own_x + distance * n_x
    scratch[contact + FACE_Y] = own_y + distance * n_y
    scratch[contact + POINT_X] = world_x
    scratch[contact + POINT_Y] = world_y
    scratch[contact + RADII] = radius + SKIN
    scratch[contact + FACE_RADIUS] = SKIN
    return count + 1


@kernel
def _touch_quad(
    scratch: NDArray[np.float64],
    count: int,
    scenario: NDArray[np.float64],
    quad: int,
    cell_x: float,
    cell_y: float,
    x: float,
    y: float,
    cos: float,
    sin: float,
) -> int:
    """Add the contact points of a cell with a quad, if any, and return the new number of points."""
    by_quad, quad_nx, quad_ny, edge = separation_along_quad(scenario, quad, x, y, cos, sin)
    if by_quad > 2.0 * SKIN:
        return count
    corners = quad_to_cell_frame(scenario, quad, x, y, cos, sin, scratch)
    by_cell, cell_nx, cell_ny, face = separation_along_cell(scratch, corners)
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
        opposite = _facing_edge(scenario, quad, cos * n_x - sin * n_y, sin * n_x + cos * n_y)
        p_x0, p_y0, p_x1, p_y1 = edge_of_quad(scratch, corners, opposite)
        kind = FACE_OF_ROBOT
    else:
        n_x = quad_nx
        n_y = quad_ny
        f_x0, f_y0, f_x1, f_y1 = edge_of_quad(scratch, corners, edge)
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
        share = 0.0 if first == second else (along - first) / (second - first)
        if first == second and end == 1:
            share = 1.0
        p_x = p_x0 + share * (p_x1 - p_x0)
        p_y = p_y0 + share * (p_y1 - p_y0)
        if n_x * (p_x - f_x0) + n_y * (p_y - f_y0) > 2.0 * SKIN or not _has_room(scratch, count):
            continue
        contact = contact_at(count)
        scratch[contact + KIND] = kind
        # A clipped point belongs to a corner of the reference face and the facing edge, any other
        # to the reference face and the edge's corner.
        clipped = along != (first if end == 0 else second)
        corner = opposite if clipped else (opposite + end) % 4
        scratch[contact + KEY] = ((kind * 2.0 + clipped) * 4.0 + edge) * 4.0 + corner
        scratch[contact + RADII] = 2.0 * SKIN
        scratch[contact + FACE_RADIUS] = SKIN
        if kind == FACE_OF_WALL:
            scratch[contact + FACE_NX] = cos * n_x - sin * n_y
            scratch[contact + FACE_NY] = sin * n_x + cos * n_y
            scratch[contact + FACE_X] = x + cos * f_x0 - sin * f_y0
            scratch[contact + FACE_Y] = y + sin * f_x0 + cos * f_y0
            scratch[contact + POINT_X] = cell_x + p_x
            scratch[contact + POINT_Y] = cell_y + p_y
        else:
            scratch[contact + FACE_NX] = n_x
            scratch[contact + FACE_NY] = n_y
            scratch[contact + FACE_X] = cell_x + f_x0
            scratch[contact + FACE_Y] = cell_y + f_y0
            scratch[contact + POINT_X] = x + cos * p_x - sin * p_y
            scratch[contact + POINT_Y] = y + sin * p_x + cos * p_y
        count += 1
    return count


@kernel
def _facing_edge(scenario: NDArray[np.float64], quad: int, n_x: float, n_y: float) -> int:
    """The quad's edge whose outward normal is most opposed to a world direction."""
    best = 2.0
    best_edge = 0
    for corner in range(int(scenario[quad + QUAD_CORNERS])):
        edge = quad + QUAD_EDGES + 3 * corner
        if scenario[edge] == 0.0 and scenario[edge + 1] == 0.0:
            continue
        opposed = n_x * scenario[edge] + n_y * scenario[edge + 1]
        if opposed < best:
            best = opposed
            best_edge = corner
    return best_edge


@kernel
def _facing_face(n_x: float, n_y: float) -> int:
    """The cell's face whose outward normal is most opposed to a direction."""
    best = 2.0
    best_face = 0
    for face in range(CELL_FACES):
        f_x, f_y = face_of_cell(face)
        opposed = n_x * f_x + n_y * f_y
        if opposed < best:
            best = opposed
            best_face = face
    return best_face
