"""Where each quantity lies in the flat arrays that the kernels read and write.

Kernels take float64 and int32 vectors rather than objects, so that they compile for other targets
too. All lengths are in units, times in seconds, angles in radians; world frame unless said.
"""

from __future__ import annotations

# Settings of a task: float64, shape (SETTINGS_SIZE,). The same for all robots of a call.
SETTING_EXTENT = 0
"""Half the playfield's side, P."""
SETTING_INVERSE_SQUARE = 1
"""1 for the inverse-square distance score, 0 for the exponential one."""
SETTING_SUCCESS_RADIUS = 2
SETTING_HAS_BALL = 3
SETTINGS_SIZE = 4

# State of one run: float64, shape (STATE_SIZE,).
STATE_X = 0
"""Centre of mass, not the grid's centre."""
STATE_Y = 1
STATE_ANGLE = 2
STATE_VX = 3
STATE_VY = 4
STATE_OMEGA = 5
STATE_COS = 6
"""Cosine and sine of the angle, which sensing and the next step both need."""
STATE_SIN = 7
STATE_BALL_X = 8
STATE_BALL_Y = 9
STATE_BALL_VX = 10
STATE_BALL_VY = 11
STATE_BALL_OMEGA = 12
STATE_SUCCESS = 13
"""1 as soon as the episode has succeeded."""
STATE_CROSSED = 14
"""1 as soon as the grid's centre has been above y = 0."""
STATE_TOUCHED = 15
"""1 if the robot touched the light, the ball or a wall in the last step."""
STATE_CLEARANCE = 16
"""How far the robot can move at least before it can touch the light or a wall."""
STATE_CLOSEST = 17
"""Least distance yet from the robot to the light or ball; then from the ball to the target."""
STATE_MEMORY = 19
"""Number of contact points whose impulses are kept for the next step."""
STATE_MEMORIES = 20
"""One record of MEMORY_SIZE for each of at most MEMORIES contact points."""
MEMORIES = 16
MEMORY_KEY = 0
"""Which cell touches what with which feature."""
MEMORY_NORMAL = 1
"""Normal impulse."""
MEMORY_TANGENT = 2
"""Friction impulse."""
MEMORY_SIZE = 3
STATE_SIZE = STATE_MEMORIES + MEMORIES * MEMORY_SIZE

# Constants of one robot, float64, shape (robot_size(n),): a header, then rows of n * n places, of
# which the first so many are used: per wheel 3 (twist change per unit of gas), per sensor 2
# (position), per exposed cell 2 (centre's position). Positions are in the body frame relative to
# the centre of mass.
ROBOT_INVERSE_MASS = 0
ROBOT_INVERSE_INERTIA = 1
ROBOT_CENTER_X = 2
"""Centre of mass relative to the grid's centre, body frame."""
ROBOT_CENTER_Y = 3
ROBOT_RADIUS = 4
"""Radius about the centre of mass that holds every cell."""
ROBOT_DAMPING = 5
"""3 x 3, row by row: twist change per unit of twist in one step, body frame."""
ROBOT_HEADER = 14

# Indices of one robot, int32, shape (cells_size(n),): a header, then the flat grid index of each
# wheel (n * n places), of each sensor (n * n places), and whether each sensor senses the target
# (n * n places).
CELLS_GRID_SIZE = 0
CELLS_WHEELS = 1
"""Number of wheels; likewise below."""
CELLS_SENSORS = 2
CELLS_EXPOSED = 3
CELLS_HEADER = 4

# Scenario of one run, float64, shape (scenario_size(quads),): a header, then one record per wall
# quad, in order of increasing lower edge.
SCENARIO_START_X = 0
SCENARIO_START_Y = 1
SCENARIO_SEEN_X = 2
"""The light, or the ball's start."""
SCENARIO_SEEN_Y = 3
SCENARIO_TARGET_X = 4
"""NaN in tasks without a target."""
SCENARIO_TARGET_Y = 5
SCENARIO_QUADS = 6
"""Number of wall quads."""
SCENARIO_HEADER = 7

QUAD_LOW_Y = 0
QUAD_HIGH_Y = 1
QUAD_LOW_X = 2
QUAD_HIGH_X = 3
QUAD_CORNERS = 4
"""Number of corners of the convex hull, 3 or 4."""
QUAD_POINTS = 5
"""x and y of each corner, counter-clockwise."""
QUAD_EDGES = 13
"""Of the edge from each corner to the next: its outward unit normal, and that times a point on it
(3 numbers an edge; the normal is zero where two corners coincide)."""
QUAD_SIZE = 25


def robot_size(grid_size: int) -> int:
    """Length of a robot's float64 record."""
    return ROBOT_HEADER + 7 * grid_size * grid_size


def cells_size(grid_size: int) -> int:
    """Length of a robot's int32 record."""
    return CELLS_HEADER + 3 * grid_size * grid_size


def scenario_size(quads: int) -> int:
    """Length of a scenario's record with room for that many wall quads."""
    return SCENARIO_HEADER + QUAD_SIZE * quads
