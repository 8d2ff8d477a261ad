"""Pictures of an episode or a body, and a window to show them in.

A ``Scene`` holds everything to draw, for any simulator. Only ``Window`` needs a display, and pygame
is imported only when something is drawn.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.body import CELL_SIZE, BodyGrid, Cell, cell_centers
from ncrs_envs.canvas import (
    AMBER,
    BORDER,
    CELL_EDGE,
    GREEN,
    GRID,
    GROUND,
    ROSE,
    SENSOR_BASE,
    SKY,
    TISSUE,
    VERMILION,
    WALL,
    WALL_EDGE,
    WHEEL_BASE,
    WHITE,
    Canvas,
    Color,
    Point,
    View,
    mix,
)
from ncrs_envs.errors import NCRSError
from ncrs_envs.physics import BALL_RADIUS, LIGHT_RADIUS, TARGET_SIDE
from ncrs_envs.scenario import WALL_EXTENT

DEFAULT_RENDER_SIZE = 512
MIN_RENDER_SIZE = 64
MAX_RENDER_SIZE = 2048

_MARGIN = 1.01
"""Half width of the view, as a multiple of the walls' extent."""
_GRID_LINES = 12
_OUTLINE = 0.2
"""Width of the light edge around a robot, in units."""
_INSET_FRACTION = 0.2
"""Side of the close-up of the robot, as a fraction of the picture's."""
_MIN_INSET_PIXELS = 40
_MIN_MAGNIFICATION = 1.3


class RenderError(NCRSError, ValueError):
    """A picture size outside the allowed range."""


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything to draw, in world coordinates and units."""

    extent: float
    """Half the playfield's side, P."""
    body: BodyGrid
    """Cell codes, int8 ``(n, n)``."""
    pose: tuple[float, float, float]
    """Robot centre x and y, and heading in radians (0 is +y)."""
    sensor_values: NDArray[np.float32]
    """Sensor values in [0, 1], shape ``(n, n)``, read in sensor cells."""
    action: NDArray[np.float32]
    """Gas, shape ``(n, n)``, read in wheel cells."""
    light: Point | None
    ball: Point | None
    target: Point | None
    wall_quads: NDArray[np.float64]
    """Walls as quadrilaterals, shape ``(quads, 4, 2)``, see ``wall_quads``."""
    path: NDArray[np.float64]
    """Robot centres so far, oldest first, shape ``(steps + 1, 2)``."""
    success: bool
    success_radius: float


def check_render_size(size: Any) -> int:
    """Return the side of a picture in pixels as an int.

    Raises:
        RenderError: ``size`` is not an integer from ``MIN_RENDER_SIZE`` to ``MAX_RENDER_SIZE``.
    """
    whole = isinstance(size, int | np.integer) and not isinstance(size, bool)
    if not whole or not MIN_RENDER_SIZE <= size <= MAX_RENDER_SIZE:
        raise RenderError(
            f"render_size must be an integer from {MIN_RENDER_SIZE} to {MAX_RENDER_SIZE} pixels, "
            f"got {size!r}."
        )
    return int(size)


def draw_scene(
    scene: Scene, size: int = DEFAULT_RENDER_SIZE, *, inset: bool = True
) -> NDArray[np.uint8]:
    """Draw a scene with its walls, seen from above with +y up.

    Args:
        scene: Scene to draw.
        size: Side of the picture in pixels.
        inset: True to show a robot that would be small again in a corner, larger and heading up.

    Returns:
        RGB, uint8 ``(size, size, 3)``.

    Raises:
        RenderError: ``size`` is out of range.
    """
    canvas = Canvas(check_render_size(size), GROUND)
    view = canvas.fit(WALL_EXTENT * scene.extent * _MARGIN)
    _draw_field(canvas, view, scene)
    _draw_light_and_target(canvas, view, scene)
    _draw_path(canvas, view, scene.path)
    if scene.ball is not None:
        canvas.glow(view, scene.ball, 0.08 * scene.extent, AMBER, 0.5)
        canvas.disc(view, scene.ball, BALL_RADIUS, AMBER)
        canvas.ring(view, scene.ball, BALL_RADIUS, WHITE, 0.25)
    robot_view = view.placed(scene.pose[:2], scene.pose[2])
    _draw_robot(canvas, robot_view, scene.body, scene.sensor_values, scene.action)
    if inset:
        _draw_inset(canvas, view, scene)
    return canvas.image()


def draw_body(
    body: BodyGrid,
    size: int = DEFAULT_RENDER_SIZE,
    *,
    sensor_values: NDArray[np.floating] | None = None,
    action: NDArray[np.floating] | None = None,
) -> NDArray[np.uint8]:
    """Draw a body alone, front up.

    Args:
        body: Cell codes, shape ``(n, n)``.
        size: Side of the picture in pixels.
        sensor_values: Sensor values in [0, 1], shape ``(n, n)``; None for 1 in all sensors.
        action: Gas, shape ``(n, n)``; None for 0 in all wheels.

    Returns:
        RGB, uint8 ``(size, size, 3)``.

    Raises:
        RenderError: ``size`` is out of range.
    """
    canvas = Canvas(check_render_size(size), GROUND)
    n = body.shape[0]
    view = canvas.fit((n + 1) * CELL_SIZE / 2.0)
    for center in cell_centers(n).reshape(-1, 2).tolist():
        canvas.box(view, (center[0], center[1]), (0.96, 0.96), GRID)
    values = np.ones(body.shape) if sensor_values is None else sensor_values
    _draw_robot(canvas, view, body, values, np.zeros(body.shape) if action is None else action)
    return canvas.image()


def _draw_field(canvas: Canvas, view: View, scene: Scene) -> None:
    """Draw the grid, the border of the playfield, and the walls."""
    extent = scene.extent
    for at in np.linspace(-extent, extent, _GRID_LINES + 1).tolist():
        canvas.line(view, [(at, -extent), (at, extent)], GRID, 0.0)
        canvas.line(view, [(-extent, at), (extent, at)], GRID, 0.0)
    corners = [(-extent, -extent), (extent, -extent), (extent, extent), (-extent, extent)]
    canvas.line(view, [*corners, corners[0]], BORDER, 0.0)
    quads = [[(x, y) for x, y in quad] for quad in scene.wall_quads.tolist()]
    for quad in quads:
        canvas.polygon(view, quad, WALL)
    # Vertices 1 and 2 of a quad lie on the wall's ragged edge. It is drawn last, over all quads.
    for quad in quads:
        canvas.line(view, quad[1:3], WALL_EDGE, 0.004 * extent)


def _draw_light_and_target(canvas: Canvas, view: View, scene: Scene) -> None:
    """Draw the light or the target area, with the ring that marks the success radius."""
    width = 0.005 * scene.extent
    if scene.target is not None:
        half = TARGET_SIDE / 2.0
        color = mix(GROUND, SKY, 0.6 if scene.success else 0.35)
        canvas.box(view, scene.target, (half, half), SKY)
        canvas.box(view, scene.target, (half - 2.0 * width, half - 2.0 * width), color)
        _draw_success_ring(canvas, view, scene, scene.target, SKY)
    if scene.light is not None:
        canvas.glow(view, scene.light, 0.28 * scene.extent, AMBER, 0.55)
        _draw_success_ring(canvas, view, scene, scene.light, AMBER)
        canvas.disc(view, scene.light, LIGHT_RADIUS, mix(AMBER, WHITE, 0.75))


def _draw_success_ring(
    canvas: Canvas, view: View, scene: Scene, center: Point, color: Color
) -> None:
    radius, extent = scene.success_radius, scene.extent
    if scene.success:
        canvas.ring(view, center, radius, color, 0.012 * extent)
    else:
        canvas.dashed_ring(view, center, radius, mix(GROUND, color, 0.7), 0.005 * extent)


def _draw_path(canvas: Canvas, view: View, path: NDArray[np.float64]) -> None:
    """Draw the path so far, brighter towards the present."""
    points = [(x, y) for x, y in path.tolist()]
    for k in range(1, len(points)):
        color = mix(GROUND, WHITE, 0.3 + 0.5 * k / len(points))
        canvas.line(view, points[k - 1 : k + 1], color, 0.6)


def _draw_robot(
    canvas: Canvas,
    view: View,
    body: BodyGrid,
    values: NDArray[np.floating],
    action: NDArray[np.floating],
) -> None:
    """Draw all cells of a body, in the body frame."""
    half = CELL_SIZE / 2.0
    cells = np.argwhere(body != Cell.EMPTY)
    centers = [(float(x), float(y)) for x, y in cell_centers(body.shape[0])[tuple(cells.T)]]
    for center in centers:
        canvas.box(view, center, (half + _OUTLINE, half + _OUTLINE), WHITE)
    for (row, column), center in zip(cells.tolist(), centers, strict=True):
        code = Cell(int(body[row, column]))
        canvas.box(view, center, (half, half), CELL_EDGE)
        if code is Cell.WHEEL:
            _draw_wheel(canvas, view, center, float(action[row, column]))
        elif code is Cell.TISSUE:
            canvas.box(view, center, (0.92, 0.92), TISSUE)
        else:
            _draw_sensor(canvas, view, center, code, float(values[row, column]))


def _draw_sensor(canvas: Canvas, view: View, center: Point, code: Cell, value: float) -> None:
    """Draw a sensor as a disc (light), diamond (target) or square (touch).

    The larger its value, the brighter it is.
    """
    canvas.box(view, center, (0.92, 0.92), SENSOR_BASE)
    if code is Cell.LIGHT_SENSOR:
        canvas.disc(view, center, 0.85, AMBER)
        canvas.disc(view, center, 0.6, _lit(AMBER, value))
        return
    if code is Cell.TOUCH_SENSOR:
        canvas.box(view, center, (0.8, 0.8), ROSE)
        canvas.box(view, center, (0.55, 0.55), _lit(ROSE, value))
        return
    x, y = center
    for reach, color in ((0.98, SKY), (0.66, _lit(SKY, value))):
        diamond = [(x - reach, y), (x, y - reach), (x + reach, y), (x, y + reach)]
        canvas.polygon(view, diamond, color)


def _lit(color: Color, value: float) -> Color:
    """Mix the colour of a sensor: nearly dark at value 0, nearly white at 1."""
    return mix(mix(GROUND, color, 0.2), mix(color, WHITE, 0.7), value)


def _draw_wheel(canvas: Canvas, view: View, center: Point, gas: float) -> None:
    """Draw a black tyre with a white arrowhead at its front and a bar for its thrust.

    The bar extends forward in green or backward in vermilion.
    """
    x, y = center
    canvas.box(view, center, (0.92, 0.92), SENSOR_BASE)
    canvas.box(view, center, (0.62, 0.92), WHEEL_BASE)
    if gas != 0.0:
        length = 0.7 * min(max(gas, -1.0), 1.0)
        bar = GREEN if gas > 0.0 else VERMILION
        canvas.box(view, (x, y - 0.2 + length / 2.0), (0.45, abs(length) / 2.0), bar)
    arrow = [(x - 0.6, y + 0.5), (x + 0.6, y + 0.5), (x, y + 0.92)]
    canvas.polygon(view, arrow, WHITE)


def _draw_inset(canvas: Canvas, view: View, scene: Scene) -> None:
    """Draw the robot again, larger and heading up, in a free corner."""
    n = scene.body.shape[0]
    side = _INSET_FRACTION * canvas.side
    scale = side / ((n + 1) * CELL_SIZE)
    pixels = side / canvas.samples
    if pixels < _MIN_INSET_PIXELS or scale < _MIN_MAGNIFICATION * view.scale:
        return
    reach = canvas.side / view.scale / 2.0
    half = side / view.scale / 2.0
    center = _free_corner(scene, reach - half - 0.01 * reach, half)
    canvas.box(view, center, (half, half), BORDER)
    edge = 1.5 * canvas.samples / view.scale
    canvas.box(view, center, (half - edge, half - edge), GROUND)
    inset = View(scale, view.pixel(center))
    _draw_robot(canvas, inset, scene.body, scene.sensor_values, scene.action)


def _free_corner(scene: Scene, at: float, half: float) -> Point:
    """Choose the corner for the close-up.

    Args:
        scene: Scene that the close-up must not hide.
        at: Distance of the corners' centres from the axes, in units.
        half: Half the side of the close-up, in units.

    Returns:
        Centre of the first corner, clockwise from the upper left, that hides neither robot, light,
        ball nor target. If each hides something, the one farthest from everything.
    """
    marks: list[tuple[Point, float]] = [(scene.pose[:2], scene.body.shape[0] * CELL_SIZE / 2.0)]
    success_center = scene.light if scene.target is None else scene.target
    if success_center is not None:
        marks.append((success_center, scene.success_radius))
    if scene.ball is not None:
        marks.append((scene.ball, BALL_RADIUS))

    def clearance(corner: Point) -> float:
        x, y = corner
        return min(max(abs(p[0] - x), abs(p[1] - y)) - half - radius for p, radius in marks)

    corners = [(-at, at), (at, at), (at, -at), (-at, -at)]
    free = [corner for corner in corners if clearance(corner) > 0.0]
    return free[0] if free else max(corners, key=clearance)


class Window:
    """A window on the screen that shows frames at the pace of the episode.

    When the user closes it, further frames are dropped and the program continues.

    Args:
        title: Title of the window.
        fps: Maximum number of frames per second; ``show`` waits if it is called faster.
    """

    def __init__(self, title: str, fps: float) -> None:
        self._title = title
        self._fps = fps
        self._screen: Any = None
        self._clock: Any = None
        self.closed = False
        """True after the user, or ``close``, has closed the window."""

    def show(self, frame: NDArray[np.uint8]) -> None:
        """Show an RGB frame, uint8 ``(height, width, 3)``; the first call opens the window."""
        if self.closed:
            return
        import pygame

        if self._screen is None:
            pygame.display.init()
            pygame.display.set_caption(self._title)
            self._screen = pygame.display.set_mode((frame.shape[1], frame.shape[0]))
            self._clock = pygame.time.Clock()
        if any(event.type == pygame.QUIT for event in pygame.event.get()):
            self.close()
            return
        pygame.surfarray.blit_array(self._screen, frame.transpose(1, 0, 2))
        pygame.display.flip()
        self._clock.tick(self._fps)

    def close(self) -> None:
        """Close the window; further calls change nothing."""
        self.closed = True
        if self._screen is not None:
            import pygame

            pygame.display.quit()
            self._screen = None
