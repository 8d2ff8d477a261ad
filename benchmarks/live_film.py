"""A film of the page of live robots: ``python -m benchmarks.live_film assets/live.gif``.

A hand leads the robot with the light, cuts wheels off, and lets it grow again. The page is driven
frame by frame, so that the film runs at true speed however slow the computer is.
"""

from __future__ import annotations

import argparse
import io
import math
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from benchmarks.browser import resize, start_chromium
from ncrs.live.build import write_page
from ncrs.live.robots import robot_by_hand

FRAMES_PER_SECOND = 12.5
COLORS = 200
"""Maximum number of colours of the film."""
_APART = 9
"""Minimum difference between two of them, in the channel in which they differ most."""
_SAMPLE = 20
"""Distance in frames between those whose colours are counted."""
PAGE = (1120, 700)
"""Size of the page in pixels."""
WIDTH = 800
"""Width of the film in pixels."""
CUT = (10, 11)
"""Flat indices of the cells that are cut off: two wheels on the left."""
_ARROW = ((0, 0), (0, 17), (4, 13), (7, 20), (10, 19), (7, 12), (12, 12))
_START = """
const { app } = NCRSLive;
app.isCalm = false;
app.play(true);
app.isPlaying = false;
app.touched();
document.body.classList.add('is-framed');
document.querySelector('.choice').hidden = true;
"""
_FRAME = """
const { app } = NCRSLive, [seconds] = arguments;
app.isPlaying = true;
for (let i = 0; i < 4; i++) app.advance(seconds / 4);
app.isPlaying = false;
for (let i = 0; i < 4; i++) app.draw(seconds / 4);
return app.session.phase;
"""
_CUT = """
const { app } = NCRSLive;
app.session.setCell(arguments[0], 0);
app.changed('');
"""
_PLACES = """
const { app } = NCRSLive, canvas = document.getElementById('stage');
const stage = canvas.getBoundingClientRect();
const body = document.getElementById('body').getBoundingClientRect();
const { world } = app.session, half = world.extent * world.wallExtent * 1.01;
return { stage: [stage.x, stage.y, stage.width], half, body: [body.x, body.y, body.width] };
"""


def led(time: float) -> tuple[float, float]:
    """Return the place of the light, in units, on a figure of eight."""
    angle = 2.0 * math.pi * time / 7.0
    return 42.0 * math.sin(angle), 38.0 * math.sin(2.0 * angle)


class Film:
    """Frames of the page, with the pointer drawn into them."""

    def __init__(self, driver: Any) -> None:
        self._driver = driver
        self._places = driver.execute_script(_PLACES)
        self.frames: list[Image.Image] = []

    def on_field(self, x: float, y: float) -> tuple[float, float]:
        """Return the pixel of a place in the playfield."""
        left, top, side = self._places["stage"]
        scale = side / (2.0 * self._places["half"])
        return left + side / 2.0 + x * scale, top + side / 2.0 - y * scale

    def on_body(self, cell: int) -> tuple[float, float]:
        """Return the pixel of a cell in the large picture of the body."""
        left, top, side = self._places["body"]
        row, column = divmod(cell, 5)
        return left + side * (0.3 + column + 0.5) / 5.6, top + side * (0.3 + row + 0.5) / 5.6

    def add(self, pointer: tuple[float, float] | None) -> str:
        """Advance the page by a frame and keep the picture; return the robot's phase."""
        phase: str = self._driver.execute_script(_FRAME, 1.0 / FRAMES_PER_SECOND)
        picture = Image.open(io.BytesIO(self._driver.get_screenshot_as_png())).convert("RGB")
        if pointer is not None:
            corners = [(pointer[0] + x, pointer[1] + y) for x, y in _ARROW]
            ImageDraw.Draw(picture).polygon(corners, fill="white", outline="black")
        height = round(WIDTH * picture.height / picture.width)
        self.frames.append(picture.resize((WIDTH, height), Image.Resampling.LANCZOS))
        return phase


def glide(
    start: tuple[float, float], end: tuple[float, float], frames: int
) -> Iterator[tuple[float, float]]:
    """Yield places on the way of the pointer, slower at both ends."""
    for frame in range(1, frames + 1):
        part = 0.5 - 0.5 * math.cos(math.pi * frame / frames)
        yield start[0] + (end[0] - start[0]) * part, start[1] + (end[1] - start[1]) * part


def record(driver: Any, page: Path) -> list[Image.Image]:
    """Play the scenes and return their frames."""
    resize(driver, *PAGE)
    driver.execute_cdp_cmd("Emulation.setScrollbarsHidden", {"hidden": True})
    driver.get(page.as_uri())
    wait = "return document.body.dataset.ready === 'true'"
    while not driver.execute_script(wait):
        pass
    driver.execute_script(_START)
    film = Film(driver)

    def lead(seconds: float, start: float) -> float:
        for frame in range(round(seconds * FRAMES_PER_SECOND)):
            time = start + frame / FRAMES_PER_SECOND
            driver.execute_script("NCRSLive.app.moveThing('light', arguments[0])", led(time))
            film.add(film.on_field(*led(time)))
        return start + seconds

    def grow() -> None:
        while film.add(None) == "growing":
            pass

    grow()
    time = lead(7.0, 0.5)
    at = film.on_field(*led(time))
    for cell in CUT:
        for pointer in glide(at, film.on_body(cell), 6):
            film.add(pointer)
        at = film.on_body(cell)
        driver.execute_script(_CUT, cell)
        film.add(at)
    for pointer in glide(at, film.on_field(*led(time)), 6):
        film.add(pointer)
    time = lead(2.5, time)
    driver.execute_script("NCRSLive.app.growAgain(true)")
    driver.execute_script("NCRSLive.app.isPlaying = false")
    grow()
    lead(2.5, time)
    return film.frames


def palette_of(frames: list[Image.Image]) -> Image.Image:
    """Choose the colours of a film: the most frequent ones that differ enough from each other."""
    pixels = np.concatenate([np.asarray(frame).reshape(-1, 3) for frame in frames[::_SAMPLE]])
    colors, counts = np.unique(pixels, axis=0, return_counts=True)
    chosen: list[NDArray[np.int64]] = []
    for color in colors[np.argsort(-counts)].astype(np.int64):
        if len(chosen) == COLORS:
            break
        if not chosen or np.abs(np.array(chosen) - color).max(axis=1).min() >= _APART:
            chosen.append(color)
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.array(chosen, dtype=np.uint8).tobytes())
    return palette


def save(frames: list[Image.Image], path: Path) -> None:
    """Write frames as an animated GIF."""
    palette = palette_of(frames)
    reduced = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    duration = round(1000 / FRAMES_PER_SECOND)
    reduced[0].save(path, save_all=True, append_images=reduced[1:], duration=duration, loop=0)


def main() -> None:
    """Record the film and print its size."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("path", type=Path, help="GIF to write")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        page = write_page(Path(folder) / "live.html", [robot_by_hand()]).path
        driver = start_chromium(Path(folder) / "profile")
        try:
            frames = record(driver, page)
        finally:
            driver.quit()
    save(frames, options.path)
    print(f"{len(frames)} frames, {options.path.stat().st_size / 1e6:.2f} MB: {options.path}")


if __name__ == "__main__":
    main()
