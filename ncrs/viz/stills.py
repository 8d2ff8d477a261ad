"""Pictures made without matplotlib: bodies in a strip, heatmaps, text on frames."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from ncrs.viz.archive_grid import ArchiveGrid
from ncrs_envs.body import BodyGrid
from ncrs_envs.canvas import AMOUNTS, BORDER, GRID, GROUND, WHITE, Color, Point
from ncrs_envs.rendering import draw_body

Picture = NDArray[np.uint8]
"""RGB, ``(height, width, 3)``."""

_GAP = 6


def ramp(
    values: NDArray[np.floating], low: float, high: float, scale: Sequence[Color] = AMOUNTS
) -> Picture:
    """Colour values on a scale, its first colour at ``low`` and its last at ``high``.

    Returns:
        RGB, uint8, with one more axis of 3 than ``values``.
    """
    stops = np.asarray(scale, dtype=np.float64)
    fraction = np.clip((values - low) / (high - low if high > low else 1.0), 0.0, 1.0)
    place = fraction * (len(stops) - 1)
    below = np.minimum(place.astype(int), len(stops) - 2)
    rest = (place - below)[..., None]
    return np.asarray(stops[below] * (1.0 - rest) + stops[below + 1] * rest + 0.5, dtype=np.uint8)


@lru_cache(maxsize=16)
def _font(size: int) -> ImageFont.ImageFont | ImageFont.FreeTypeFont:
    return ImageFont.load_default(size)


@dataclass(frozen=True)
class Lettering:
    """Size in pixels, colour and anchor of a text; anchors are named as in Pillow."""

    size: int
    color: Color = WHITE
    anchor: str = "la"


def write(picture: Picture, at: Point, text: str, look: Lettering) -> Picture:
    """Write text on a copy of a picture."""
    image = Image.fromarray(picture)
    ImageDraw.Draw(image).multiline_text(
        at, text, fill=look.color, font=_font(look.size), anchor=look.anchor
    )
    return np.array(image)


def ground(height: int, width: int) -> Picture:
    """Make an empty picture."""
    return np.full((height, width, 3), GROUND, dtype=np.uint8)


def strip(
    bodies: Sequence[BodyGrid] | NDArray[np.int8], captions: Sequence[str], side: int = 96
) -> Picture:
    """Draw bodies side by side, each with a caption below.

    Args:
        bodies: Cell codes of at least one body.
        captions: Caption of each body.
        side: Side of a body in pixels.
    """
    text = max(10, side // 8)
    picture = ground(side + 3 * text, len(bodies) * (side + _GAP) - _GAP)
    for index, body in enumerate(bodies):
        left = index * (side + _GAP)
        picture[:side, left : left + side] = draw_body(body, side)
    for index, caption in enumerate(captions):
        middle = index * (side + _GAP) + side / 2
        picture = write(picture, (middle, side + text / 2), caption, Lettering(text, anchor="ma"))
    return picture


def heatmaps(
    grid: ArchiveGrid, low: float, high: float, *, columns: int = 6, pixels: int = 5
) -> Picture:
    """Draw all panels of an archive: sensors to the right, wheels upwards, number of cells above.

    Args:
        grid: Panels to draw.
        low: Value at the lower end of the colour scale.
        high: Value at its upper end.
        columns: Number of panels in a row.
        pixels: Side of a panel's cell in pixels.
    """
    panels, sensors, wheels = grid.values.shape
    text = 12
    width, height = sensors * pixels + _GAP, wheels * pixels + text + 2 * _GAP
    rows = math.ceil(panels / columns)
    footer = 2 * text
    picture = ground(rows * height + footer, columns * width)
    for index in range(panels):
        top, left = index // columns * height + text + _GAP, index % columns * width
        panel = np.full((sensors, wheels, 3), GROUND, dtype=np.uint8)
        panel[grid.possible[index]] = GRID
        filled = ~np.isnan(grid.values[index])
        panel[filled] = ramp(grid.values[index][filled], low, high)
        upwards = panel.transpose(1, 0, 2)[::-1].repeat(pixels, axis=0).repeat(pixels, axis=1)
        picture[top : top + wheels * pixels, left : left + sensors * pixels] = upwards
        picture[top + wheels * pixels, left : left + sensors * pixels] = BORDER
    for index in range(panels):
        at = (float(index % columns * width), float(index // columns * height + 2))
        picture = write(picture, at, f"{grid.cells[index]} cells", Lettering(text))
    label = f"fitness {low:.3f} (dark) to {high:.3f} (yellow);  x: sensors, y: wheels"
    return write(picture, (2.0, picture.shape[0] - 1.5 * text), label, Lettering(text))
