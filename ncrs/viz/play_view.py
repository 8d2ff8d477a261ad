"""The picture of the game: arenas above, and editor, palette, sensors and keys below."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ncrs.viz.play_session import Lane, PlaySession
from ncrs.viz.stills import Lettering, Picture, ground, write
from ncrs_envs.body import Cell, sensor_mask
from ncrs_envs.canvas import (
    AMBER,
    BORDER,
    GREEN,
    ROSE,
    SENSOR_BASE,
    SKY,
    TISSUE,
    VERMILION,
    WHITE,
    Color,
)
from ncrs_envs.rendering import draw_body, draw_scene
from ncrs_envs.tasks import MAX_EPISODE_STEPS, Task

ARENA = 420
_TITLE = 26
_DESK = 250
_EDITOR = 200
_MARGIN = 16
_PALETTE = 30
_BETWEEN = 8
_TEXT = 14
_BARS = 110
_SENSOR_COLORS = {Cell.LIGHT_SENSOR: AMBER, Cell.TARGET_SENSOR: SKY, Cell.TOUCH_SENSOR: ROSE}
_KEYS = (
    "arrows or WASD   drive",
    "R   restart      N   next scenario",
    "0-5 or a click   choose a cell",
    "left button   put it into the body",
    "right button   remove a cell",
    "+ and -   speed      Esc   quit",
)
_RIVAL_KEYS = ("B   take over the evolved body",)


@dataclass(frozen=True)
class Layout:
    """Positions in the window, in pixels from the upper left."""

    grid_size: int
    arenas: int
    cells: tuple[Cell, ...]

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the window."""
        return max(self.arenas * ARENA, 2 * ARENA), _TITLE + ARENA + _DESK

    @property
    def editor(self) -> tuple[int, int]:
        """Left and top of the editor."""
        return _MARGIN, _TITLE + ARENA + _MARGIN

    def palette(self, index: int) -> tuple[int, int]:
        """Compute left and top of a palette entry."""
        left, top = self.editor
        return left + _EDITOR + _MARGIN, top + index * (_PALETTE + _BETWEEN)

    def cell_at(self, x: int, y: int) -> tuple[int, int] | None:
        """Find row and column of the body's cell at a pixel; None if there is none."""
        left, top = self.editor
        # ``draw_body`` leaves half a cell of margin on each side.
        cell = _EDITOR / (self.grid_size + 1)
        column, row = ((place / cell) - 0.5 for place in (x - left, y - top))
        inside = 0 <= column < self.grid_size and 0 <= row < self.grid_size
        return (int(row), int(column)) if inside else None

    def palette_at(self, x: int, y: int) -> Cell | None:
        """Find the palette's cell type at a pixel; None if there is none."""
        for index, cell in enumerate(self.cells):
            left, top = self.palette(index)
            if left <= x < left + 5 * _PALETTE and top <= y < top + _PALETTE:
                return cell
        return None


def layout_of(session: PlaySession) -> Layout:
    """Lay out the window of a session."""
    arenas = 1 if session.rivals is None else 2
    return Layout(session.body.shape[0], arenas, session.cells)


def draw_play(session: PlaySession, chosen: Cell, speed: float, rival_title: str) -> Picture:
    """Draw the whole window, uint8 RGB.

    Args:
        session: Session to show.
        chosen: Cell type chosen in the palette.
        speed: Speed to show, as a multiple of real time.
        rival_title: Title above the evolved robot.
    """
    layout = layout_of(session)
    width, height = layout.size
    picture = ground(height, width)
    _put(picture, _arena(session.yours, "you"), 0, 0)
    if session.rivals is not None:
        _put(picture, _arena(session.rivals, rival_title), ARENA, 0)
    else:
        _put(picture, _help(ARENA), ARENA, _TITLE)
    picture[_TITLE + ARENA, :] = BORDER
    left, top = layout.editor
    _put(picture, draw_body(session.body, _EDITOR), left, top)
    palette_left, palette_top = layout.palette(0)
    _put(picture, _palette(session.task, layout.cells, chosen), palette_left - 3, palette_top - 3)
    x = palette_left + 6 * _PALETTE
    picture = _sensors(picture, session, x, top)
    if session.rivals is not None:
        _put(picture, _help(width - x - _BARS - 60, *_RIVAL_KEYS), x + _BARS + 60, top)
    text, color = _status(session, speed)
    return write(picture, (left, height - _MARGIN - 2), text, Lettering(_TEXT, color, "ls"))


def _put(picture: Picture, part: Picture, left: int, top: int) -> None:
    height = min(part.shape[0], picture.shape[0] - top)
    width = min(part.shape[1], picture.shape[1] - left)
    picture[top : top + height, left : left + width] = part[:height, :width]


def _arena(lane: Lane, name: str) -> Picture:
    scene = lane.scene
    title = f"{name}:  step {lane.steps},  fitness {lane.fitness:.3f}"
    solved = "   solved" if scene.success else ""
    color = GREEN if solved else WHITE
    head = write(ground(_TITLE, ARENA), (8, 5), title + solved, Lettering(_TEXT, color))
    return np.concatenate([head, draw_scene(scene, ARENA)], axis=0)


@lru_cache(maxsize=4)
def _help(width: int, *more: str) -> Picture:
    panel = ground(_DESK - 2 * _MARGIN - _TEXT, width)
    return write(panel, (12, 4), "\n".join((*_KEYS, *more)), Lettering(_TEXT, TISSUE))


@lru_cache(maxsize=16)
def _palette(task: Task, cells: tuple[Cell, ...], chosen: Cell) -> Picture:
    """Draw the cells to choose from with their codes, each with room for a frame of 3 pixels."""
    step = _PALETTE + _BETWEEN
    picture = ground(len(cells) * step, 5 * _PALETTE + 6)
    for index, cell in enumerate(cells):
        top = index * step + 3
        if cell is chosen:
            picture[top - 3 : top + _PALETTE + 3] = SENSOR_BASE
        _put(picture, _sample(cell), 3, top)
        at = (_PALETTE + 11, top + _PALETTE / 2)
        label = f"{int(cell)}  {task.cell_label(cell)}"
        picture = write(picture, at, label, Lettering(_TEXT, anchor="lm"))
    return picture


def _sample(cell: Cell) -> Picture:
    """One cell, cut out of a drawn body."""
    body = np.zeros((3, 3), dtype=np.int8)
    body[1, 1] = int(cell)
    side = 4 * _PALETTE  # three cells, and half a cell of margin on each side
    start = (side - _PALETTE) // 2
    return draw_body(body, side)[start : start + _PALETTE, start : start + _PALETTE]


def _sensors(picture: Picture, session: PlaySession, left: int, top: int) -> Picture:
    """Draw a bar for each sensor, in row order, as far as there is room."""
    values = session.yours.scene.sensor_values
    body = session.yours.scene.body
    picture = write(picture, (left, top), "your sensors", Lettering(_TEXT))
    room = (_EDITOR - 24) // 18
    places = np.argwhere(sensor_mask(body))
    for index, (row, column) in enumerate(places[: room - (len(places) > room)]):
        y = top + 24 + 18 * index
        value = float(values[row, column])
        color = _SENSOR_COLORS[Cell(int(body[row, column]))]
        picture[y : y + 12, left : left + _BARS] = SENSOR_BASE
        picture[y : y + 12, left : left + round(_BARS * value)] = color
        at = (left + _BARS + 8, y + 6)
        picture = write(picture, at, f"{value:.2f}", Lettering(_TEXT - 2, anchor="lm"))
    if len(places) > room:
        y = top + 24 + 18 * (room - 1)
        text = f"and {len(places) - room + 1} more"
        picture = write(picture, (left, y), text, Lettering(_TEXT - 2, TISSUE))
    return picture


def _status(session: PlaySession, speed: float) -> tuple[str, Color]:
    """Say in one line what to do now; returns text and colour."""
    if session.problem is not None:
        return session.problem, VERMILION
    if session.finished:
        return f"{MAX_EPISODE_STEPS} steps are over: R to try again, N for another scenario", AMBER
    if not session.started:
        return "The clock starts when you drive.", AMBER
    return f"speed {speed:g} of real time", TISSUE
