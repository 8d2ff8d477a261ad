"""A supersampled drawing surface in world coordinates, and the colours.

The canvas is a plain surface in memory, so drawing needs no display. pygame is imported lazily.
"""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Color = tuple[int, int, int]
Point = tuple[float, float]

# Hues from Okabe and Ito's colour-blind-safe set. A sensor and what it senses share a hue, and
# shapes repeat every distinction that a colour makes.
AMBER: Color = (240, 180, 20)
SKY: Color = (86, 180, 233)
ROSE: Color = (204, 121, 167)
GREEN: Color = (0, 190, 140)
VERMILION: Color = (235, 105, 20)
WHITE: Color = (240, 243, 246)
GROUND: Color = (21, 24, 30)
GRID: Color = (30, 34, 42)
BORDER: Color = (92, 102, 116)
WALL: Color = (74, 82, 95)
WALL_EDGE: Color = (142, 151, 165)
TISSUE: Color = (158, 167, 179)
CELL_EDGE: Color = (44, 49, 58)
SENSOR_BASE: Color = (58, 64, 75)
WHEEL_BASE: Color = (10, 11, 14)

AMOUNTS: Sequence[Color] = (
    (68, 1, 84), (71, 45, 123), (59, 82, 139), (44, 114, 142), (33, 145, 140),
    (40, 174, 128), (94, 201, 98), (173, 220, 48), (253, 231, 37),
)  # fmt: skip
"""Colour scale for amounts, in equal steps: viridis, even in lightness, colour-blind-safe. Fitness
and generation run from the lowest to the highest elite on show, success from 0 to 1."""
SIGNED: Sequence[Color] = (
    (8, 64, 129), (67, 147, 195), (247, 247, 247), (241, 150, 70), (127, 59, 8),
)  # fmt: skip
"""Colour scale for signed values, the channels of an automaton: blue, white at zero, orange."""
SIGNED_LIMIT = 2.0
"""Magnitude of signed values above which colours no longer change; few values exceed it."""

_MAX_SAMPLES = 3
"""Maximum number of surface pixels along the side of a pixel of the picture."""
_MAX_SURFACE = 4096
"""Maximum side of the surface, in pixels."""
_RING_ARCS = 48


def mix(start: Color, end: Color, fraction: float) -> Color:
    """Mix two colours: ``start`` at fraction 0 (and below), ``end`` at 1 (and above)."""
    fraction = min(max(fraction, 0.0), 1.0)
    red, green, blue = (round(a + (b - a) * fraction) for a, b in zip(start, end, strict=True))
    return (red, green, blue)


@dataclass(frozen=True)
class View:
    """A map from points of a frame (y up, units) to pixels (y down): turn, scale, then move."""

    scale: float
    """Pixels per unit."""
    offset: Point
    """Pixel position of the frame's origin."""
    angle: float = 0.0
    """Counter-clockwise turn of the frame, in radians."""

    def pixel(self, point: Point) -> Point:
        """Pixel position of a point."""
        cos, sin = math.cos(self.angle), math.sin(self.angle)
        x = cos * point[0] - sin * point[1]
        y = sin * point[0] + cos * point[1]
        return (self.offset[0] + self.scale * x, self.offset[1] - self.scale * y)

    def placed(self, origin: Point, angle: float) -> View:
        """View of a frame that stands at ``origin``, turned by ``angle``, in this one."""
        return View(self.scale, self.pixel(origin), self.angle + angle)


class Canvas:
    """A square picture, drawn at a larger size and scaled down at the end.

    Args:
        size: Side of the finished picture in pixels.
        background: Colour of the empty picture.
    """

    def __init__(self, size: int, background: Color) -> None:
        # pygame's greeting would land in the middle of a progress bar.
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
        import pygame

        self._draw: Any = pygame.draw
        self._pygame: Any = pygame
        self._size = size
        self.samples = min(_MAX_SAMPLES, _MAX_SURFACE // size)
        self.side = size * self.samples
        self._surface: Any = pygame.Surface((self.side, self.side), depth=32)
        self._surface.fill(background)

    def fit(self, half_width: float) -> View:
        """Fit the view to the picture: ``half_width`` units to each side of the origin."""
        return View(self.side / (2.0 * half_width), (self.side / 2.0, self.side / 2.0))

    def _width(self, view: View, units: float) -> int:
        """Convert a line width to surface pixels, at least one pixel of the finished picture."""
        return max(self.samples, round(units * view.scale))

    def polygon(self, view: View, points: Sequence[Point], color: Color) -> None:
        """Draw a filled polygon."""
        self._draw.polygon(self._surface, color, [view.pixel(p) for p in points])

    def box(self, view: View, center: Point, half: Point, color: Color) -> None:
        """Draw a filled rectangle, given its half width and half height in units."""
        (x, y), (dx, dy) = center, half
        corners = [(x - dx, y - dy), (x + dx, y - dy), (x + dx, y + dy), (x - dx, y + dy)]
        self.polygon(view, corners, color)

    def line(self, view: View, points: Sequence[Point], color: Color, units: float) -> None:
        """Draw an open line with round joints, ``units`` wide."""
        width = self._width(view, units)
        pixels = [view.pixel(p) for p in points]
        for start, end in itertools.pairwise(pixels):
            self._thick_line(start, end, color, width)
            if width > 2 * self.samples:
                self._draw.circle(self._surface, color, end, width / 2.0)

    def _thick_line(self, start: Point, end: Point, color: Color, width: int) -> None:
        """Draw a rectangle along the line: pygame's own wide lines have skewed ends."""
        dx, dy = end[0] - start[0], end[1] - start[1]
        length = math.hypot(dx, dy)
        if length == 0.0:
            return
        across_x, across_y = -dy / length * width / 2.0, dx / length * width / 2.0
        corners = [
            (start[0] + across_x, start[1] + across_y),
            (end[0] + across_x, end[1] + across_y),
            (end[0] - across_x, end[1] - across_y),
            (start[0] - across_x, start[1] - across_y),
        ]
        self._draw.polygon(self._surface, color, corners)

    def disc(self, view: View, center: Point, radius: float, color: Color) -> None:
        """Draw a filled circle."""
        self._draw.circle(self._surface, color, view.pixel(center), radius * view.scale)

    def ring(self, view: View, center: Point, radius: float, color: Color, units: float) -> None:
        """Draw the outline of a circle, ``units`` wide."""
        for arc in _ring_arcs(center, radius):
            self.line(view, arc, color, units)

    def dashed_ring(
        self, view: View, center: Point, radius: float, color: Color, units: float
    ) -> None:
        """Draw the outline of a circle in dashes, ``units`` wide."""
        for arc in _ring_arcs(center, radius)[::2]:
            self.line(view, arc, color, units)

    def glow(self, view: View, center: Point, radius: float, color: Color, strength: float) -> None:
        """Add light that fades out towards ``radius``."""
        reach = max(2, round(radius * view.scale))
        halo = self._pygame.Surface((2 * reach, 2 * reach), depth=32)
        rings = 24
        for k in range(rings):
            fraction = k / (rings - 1)
            tint = mix((0, 0, 0), color, strength * fraction**2.2)
            self._draw.circle(halo, tint, (reach, reach), reach * (1.0 - k / rings))
        x, y = view.pixel(center)
        self._surface.blit(halo, (x - reach, y - reach), special_flags=self._pygame.BLEND_RGB_ADD)

    def image(self) -> NDArray[np.uint8]:
        """Return the finished picture, uint8 ``(size, size, 3)``."""
        small = self._pygame.transform.smoothscale(self._surface, (self._size, self._size))
        pixels: NDArray[np.uint8] = self._pygame.surfarray.array3d(small)
        return np.ascontiguousarray(pixels.transpose(1, 0, 2))


def _ring_arcs(center: Point, radius: float) -> list[list[Point]]:
    """Split a circle into arcs of equal length, each a line of points."""
    step = 2.0 * math.pi / _RING_ARCS
    arcs = []
    for k in range(_RING_ARCS):
        angles = np.linspace(k * step, (k + 1) * step, 5)
        arcs.append(
            [(center[0] + radius * np.cos(a), center[1] + radius * np.sin(a)) for a in angles]
        )
    return arcs
