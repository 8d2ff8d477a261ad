"""Bodies as matplotlib patches: crisp at any size. Colours and shapes follow the films'."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, PathPatch, Polygon, Rectangle
from matplotlib.path import Path
from matplotlib.transforms import Affine2D
from numpy.typing import NDArray

from ncrs_envs.body import CELL_SIZE, BodyGrid, Cell, cell_centers
from ncrs_envs.canvas import AMBER, ROSE, SKY, TISSUE, WHEEL_BASE, Color
from ncrs_envs.tasks import Task

_EDGE = "#30343c"


def _hex(color: Color) -> str:
    return "#{:02x}{:02x}{:02x}".format(*color)


_FILL = {
    Cell.TISSUE: _hex(TISSUE),
    Cell.LIGHT_SENSOR: "#f2f2f2",
    Cell.TARGET_SENSOR: "#f2f2f2",
    Cell.TOUCH_SENSOR: "#f2f2f2",
    Cell.WHEEL: _hex(WHEEL_BASE),
}


def add_body(axes: Axes, body: BodyGrid) -> None:
    """Draw a body, front up, filling the axes; empty cells as a faint grid."""
    n = body.shape[0]
    half = CELL_SIZE / 2.0
    for (row, column), code in np.ndenumerate(body):
        x, y = cell_centers(n)[row, column]
        corner = (x - half, y - half)
        if code == Cell.EMPTY:
            axes.add_patch(Rectangle(corner, CELL_SIZE, CELL_SIZE, fc="none", ec="#d8d8d8", lw=0.4))
            continue
        cell = Cell(int(code))
        axes.add_patch(Rectangle(corner, CELL_SIZE, CELL_SIZE, fc=_FILL[cell], ec=_EDGE, lw=0.6))
        for mark in _marks(cell, float(x), float(y)):
            axes.add_patch(mark)
    reach = n * half * 1.03
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


def _marks(cell: Cell, x: float, y: float) -> list[Patch]:
    if cell is Cell.LIGHT_SENSOR:
        return [Circle((x, y), 0.7, fc=_hex(AMBER), ec=_EDGE, lw=0.6)]
    if cell is Cell.TARGET_SENSOR:
        corners = [(x - 0.8, y), (x, y - 0.8), (x + 0.8, y), (x, y + 0.8)]
        return [Polygon(corners, fc=_hex(SKY), ec=_EDGE, lw=0.6)]
    if cell is Cell.TOUCH_SENSOR:
        return [Rectangle((x - 0.65, y - 0.65), 1.3, 1.3, fc=_hex(ROSE), ec=_EDGE, lw=0.6)]
    if cell is Cell.WHEEL:
        return [Polygon([(x - 0.55, y - 0.45), (x + 0.55, y - 0.45), (x, y + 0.6)], fc="white")]
    return []


def cell_legend(cells: NDArray[np.integer], tasks: Sequence[Task]) -> list[Line2D]:
    """Make legend handles for the cell types among ``cells``, named as in ``tasks``."""
    markers = {
        Cell.TISSUE: "s",
        Cell.LIGHT_SENSOR: "o",
        Cell.TARGET_SENSOR: "D",
        Cell.TOUCH_SENSOR: "s",
        Cell.WHEEL: "^",
    }
    sensors = {Cell.LIGHT_SENSOR: AMBER, Cell.TARGET_SENSOR: SKY, Cell.TOUCH_SENSOR: ROSE}
    colors = {**_FILL, **{cell: _hex(color) for cell, color in sensors.items()}}
    handles = []
    for cell, marker in markers.items():
        if (cells == cell).any():
            name = " or ".join(dict.fromkeys(task.cell_label(cell) for task in tasks))
            look: dict[str, Any] = {"marker": marker, "mfc": colors[cell], "mec": _EDGE, "mew": 0.6}
            handles.append(Line2D([], [], ls="", label=name, **look))
    return handles


def add_silhouette(
    axes: Axes, body: BodyGrid, pose: tuple[float, float, float], color: str
) -> None:
    """Draw a robot's place: its cells in one colour, with a white mark at its front."""
    x, y, angle = pose
    place = Affine2D().rotate(angle).translate(x, y) + axes.transData
    half = CELL_SIZE / 2.0
    corners = np.array([(-half, -half), (half, -half), (half, half), (-half, half), (-half, -half)])
    centers = cell_centers(body.shape[0])[body != Cell.EMPTY]
    # One path, so that no seams show between the cells.
    squares = Path.make_compound_path(*[Path(corners + center) for center in centers])
    axes.add_patch(PathPatch(squares, fc=color, ec="none", alpha=0.6, transform=place))
    reach = body.shape[0] * half
    nose = [(-0.35 * reach, 0.1 * reach), (0.35 * reach, 0.1 * reach), (0.0, 0.7 * reach)]
    axes.add_patch(Polygon(nose, fc="white", ec=_EDGE, lw=0.4, transform=place))
