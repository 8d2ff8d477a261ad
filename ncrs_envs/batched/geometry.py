"""Separation of one cell from a wall quad or a circle, in the frame of the cell.

In that frame the cell is the square from -1 to 1 on both axes (``HALF_CELL``), which makes its
faces axis-aligned. Quads are convex, with 3 or 4 corners counter-clockwise. Separations are those
of the shapes' cores, without skins; they are negative in overlap.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.layout import QUAD_CORNERS, QUAD_EDGES, QUAD_POINTS
from ncrs_envs.body import CELL_SIZE

HALF_CELL = 0.5 * CELL_SIZE
CELL_FACES = 4

Separation = tuple[float, float, float, int]
"""Signed distance, unit normal from the quad or circle towards the cell, and the face's index."""


@kernel
def quad_to_cell_frame(
    scenario: NDArray[np.float64],
    quad: int,
    x: float,
    y: float,
    cos: float,
    sin: float,
    points: NDArray[np.float64],
) -> int:
    """Write a quad's corners relative to a cell into ``points`` and return their number.

    Args:
        scenario: the scenario's record.
        quad: where the quad's record begins in it.
        x: the cell's centre, world frame; ``y`` likewise.
        y: see ``x``.
        cos: cosine of the robot's angle.
        sin: its sine.
        points: output, at least 8 numbers: x and y of each corner.
    """
    corners = int(scenario[quad + QUAD_CORNERS])
    for corner in range(corners):
        from_x = scenario[quad + QUAD_POINTS + 2 * corner] - x
        from_y = scenario[quad + QUAD_POINTS + 2 * corner + 1] - y
        points[2 * corner] = cos * from_x + sin * from_y
        points[2 * corner + 1] = cos * from_y - sin * from_x
    return corners


@kernel
def edge_of_quad(
    points: NDArray[np.float64], corners: int, edge: int
) -> tuple[float, float, float, float]:
    """Both ends of an edge: ``(x, y)`` of its first and of its second corner."""
    following = edge + 1 if edge + 1 < corners else 0
    return (
        points[2 * edge],
        points[2 * edge + 1],
        points[2 * following],
        points[2 * following + 1],
    )


@kernel
def face_of_cell(face: int) -> tuple[float, float]:
    """Outward normal of a face of the cell: right, top, left, bottom."""
    if face == 0:
        return 1.0, 0.0
    if face == 1:
        return 0.0, 1.0
    if face == 2:
        return -1.0, 0.0
    return 0.0, -1.0


@kernel
def separation_along_quad(
    scenario: NDArray[np.float64], quad: int, x: float, y: float, cos: float, sin: float
) -> Separation:
    """The largest separation along a normal of the quad's edges; arguments as above."""
    best = -math.inf
    best_x = 0.0
    best_y = 0.0
    best_edge = 0
    for corner in range(int(scenario[quad + QUAD_CORNERS])):
        edge = quad + QUAD_EDGES + 3 * corner
        n_x = scenario[edge]
        n_y = scenario[edge + 1]
        if n_x == 0.0 and n_y == 0.0:
            continue
        own_x = cos * n_x + sin * n_y
        own_y = cos * n_y - sin * n_x
        distance = n_x * x + n_y * y - scenario[edge + 2] - HALF_CELL * (abs(own_x) + abs(own_y))
        if distance > best:
            best = distance
            best_x = own_x
            best_y = own_y
            best_edge = corner
    return best, best_x, best_y, best_edge


@kernel
def separation_along_cell(points: NDArray[np.float64], corners: int) -> Separation:
    """The largest separation along a normal of the cell's faces."""
    low_x = low_y = math.inf
    high_x = high_y = -math.inf
    for corner in range(corners):
        low_x = min(low_x, points[2 * corner])
        high_x = max(high_x, points[2 * corner])
        low_y = min(low_y, points[2 * corner + 1])
        high_y = max(high_y, points[2 * corner + 1])
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
    """Distance of the cell from a point in its frame, and its direction towards the cell.

    A point inside gives minus the depth and the normal of the nearest face.
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
