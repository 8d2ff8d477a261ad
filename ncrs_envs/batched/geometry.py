"""Separation of one cell from a wall quad or a circle, in the frame of the cell.

In that frame the cell is the square from -1 to 1 on both axes (``HALF_CELL``), which makes its
faces axis-aligned. Quads are convex, with 3 or 4 corners counter-clockwise. Separations are between
the shapes' cores, without skins, and negative in overlap.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.layout import Edge, Point, Quad
from ncrs_envs.body import CELL_SIZE

HALF_CELL = 0.5 * CELL_SIZE
CELL_FACES = 4

Separation = tuple[float, float, float, int]
"""Signed distance, unit normal from the quad or circle towards the cell, and the face's index."""


class Frame(NamedTuple):
    """A cell's frame: its centre in the world, and cosine and sine of the robot's angle."""

    x: float
    y: float
    cos: float
    sin: float


@kernel
def quad_to_cell_frame(quad: Quad, frame: Frame, points: NDArray[Point]) -> int:
    """Write a quad's corners relative to a cell into ``points`` and return their number."""
    for i in range(quad.corner_count):
        corner: Point = quad.corners[i]
        from_x = corner.x - frame.x
        from_y = corner.y - frame.y
        point: Point = points[i]
        point.x = frame.cos * from_x + frame.sin * from_y
        point.y = frame.cos * from_y - frame.sin * from_x
    return quad.corner_count


@kernel
def edge_of_quad(points: NDArray[Point], edge: int) -> tuple[float, float, float, float]:
    """Return both ends of an edge: x and y of its first corner, then of its second."""
    begin: Point = points[edge]
    end: Point = points[edge + 1 if edge + 1 < len(points) else 0]
    return begin.x, begin.y, end.x, end.y


@kernel
def face_of_cell(face: int) -> tuple[float, float]:
    """Return the outward normal of a face of the cell: right, top, left, bottom."""
    if face == 0:
        return 1.0, 0.0
    if face == 1:
        return 0.0, 1.0
    if face == 2:
        return -1.0, 0.0
    return 0.0, -1.0


@kernel
def separation_along_quad(quad: Quad, frame: Frame) -> Separation:
    """Return the maximum separation of a cell along a normal of the quad's edges."""
    best = -math.inf
    best_x = 0.0
    best_y = 0.0
    best_edge = 0
    for i in range(quad.corner_count):
        edge: Edge = quad.edges[i]
        if edge.n_x == 0.0 and edge.n_y == 0.0:
            continue
        own_x = frame.cos * edge.n_x + frame.sin * edge.n_y
        own_y = frame.cos * edge.n_y - frame.sin * edge.n_x
        reach = HALF_CELL * (abs(own_x) + abs(own_y))
        distance = edge.n_x * frame.x + edge.n_y * frame.y - edge.offset - reach
        if distance > best:
            best = distance
            best_x = own_x
            best_y = own_y
            best_edge = i
    return best, best_x, best_y, best_edge


@kernel
def separation_along_cell(points: NDArray[Point]) -> Separation:
    """Return the maximum separation along a normal of the cell's faces."""
    low_x = low_y = math.inf
    high_x = high_y = -math.inf
    for i in range(len(points)):
        point: Point = points[i]
        low_x = min(low_x, point.x)
        high_x = max(high_x, point.x)
        low_y = min(low_y, point.y)
        high_y = max(high_y, point.y)
    best = low_x
    face = 0
    if low_y > best:
        best = low_y
        face = 1
    if -high_x > best:
        best = -high_x
        face = 2
    if -high_y > best:
        best = -high_y
        face = 3
    n_x, n_y = face_of_cell(face)
    return best - HALF_CELL, -n_x, -n_y, face


@kernel
def separation_from_point(x: float, y: float) -> tuple[float, float, float]:
    """Return the distance of the cell from a point in its frame, and the direction to the cell.

    For a point inside, they are minus the depth and the normal of the nearest face.
    """
    beyond_x = abs(x) - HALF_CELL
    beyond_y = abs(y) - HALF_CELL
    if beyond_x > 0.0 and beyond_y > 0.0:
        distance = math.sqrt(beyond_x * beyond_x + beyond_y * beyond_y)
        return (
            distance,
            -math.copysign(beyond_x / distance, x),
            -math.copysign(beyond_y / distance, y),
        )
    if beyond_x > beyond_y:
        return beyond_x, -math.copysign(1.0, x), 0.0
    return beyond_y, 0.0, -math.copysign(1.0, y)
