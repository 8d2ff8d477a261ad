"""Style of figures, and their files: PNG, SVG, and the data behind them as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.colors import Colormap, LinearSegmentedColormap
from matplotlib.figure import Figure

from ncrs.runs.checkpoint import write_atomically
from ncrs.runs.folders import Group, recipes_of
from ncrs_envs.canvas import Color

WIDTH = 7.0
"""Width of two columns of a page, in inches."""
COLUMN = 3.4
"""Width of one column, in inches."""
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe and Ito's hues, which the colour-blind can tell apart, darkest first."""
LINES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 1)), (0, (8, 2)))
"""Line styles, so that methods differ by more than colour."""
EMPTY_CELL = "#e4e4e4"

METHOD_NAMES = {
    "sep_cma_es": "sep-CMA-ES",
    "cma_es": "CMA-ES",
    "cma_me": "CMA-ME",
    "cma_mae": "CMA-MAE",
    "map_elites": "MAP-Elites",
    "iso_cma_es": "iso-CMA-ES",
    "drafts": "drafts",
}

_STYLE: dict[Any, Any] = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.2,
    "figure.constrained_layout.use": True,
    "savefig.dpi": 300,
    "svg.hashsalt": "ncrs",  # the same data give the same file
    "axes.unicode_minus": True,
}


def colormap(scale: Sequence[Color]) -> Colormap:
    """Convert a scale of colours to matplotlib's form."""
    return LinearSegmentedColormap.from_list("scale", np.asarray(scale) / 255.0)


@contextmanager
def style() -> Iterator[None]:
    """Make and save figures in the house style within the block, whatever style was set before."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        yield


def method_name(method: str) -> str:
    """Return an optimizer's name for display."""
    return METHOD_NAMES.get(method, method)


def recipe_name(method: str, variant: str) -> str:
    """Return an optimizer's name and the settings of the variant for display."""
    return f"{method_name(method)}, {variant}" if variant else method_name(method)


def recipe_styles(groups: Sequence[Group]) -> dict[tuple[str, str], dict[str, Any]]:
    """Assign a colour and line style to each method with its variant.

    A method that has no variants looks the same in all figures.
    """
    recipes, known = recipes_of(groups), list(METHOD_NAMES)
    if len({method for method, _ in recipes}) == len(recipes):
        places = {recipe: known.index(recipe[0]) for recipe in recipes if recipe[0] in known}
    else:
        places = {recipe: index for index, recipe in enumerate(recipes)}
    return {
        recipe: {
            "color": COLORS[places.get(recipe, -1) % len(COLORS)],
            "ls": LINES[places.get(recipe, -1) % len(LINES)],
        }
        for recipe in recipes
    }


@dataclass(frozen=True, eq=False)
class Plot:
    """A figure with the numbers that it shows."""

    name: str
    """Name of the files, without their suffix."""
    figure: Figure
    columns: Sequence[str]
    rows: Sequence[Sequence[Any]]

    def save(self, folder: Path) -> list[Path]:
        """Write PNG, SVG and CSV; returns their paths."""
        folder.mkdir(parents=True, exist_ok=True)
        paths = [folder / f"{self.name}.{kind}" for kind in ("png", "svg", "csv")]
        _write(paths[0], self._drawn("png", {"Software": None}))
        self.figure.set_layout_engine("none")  # found once, which takes most of the time
        _write(paths[1], self._drawn("svg", {"Date": None}))
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.columns)
        writer.writerows(self.rows)
        _write(paths[2], text.getvalue().encode())
        return paths

    def _drawn(self, kind: str, metadata: dict[str, None]) -> bytes:
        stream = io.BytesIO()
        self.figure.savefig(stream, format=kind, metadata=metadata)
        return stream.getvalue()


def _write(path: Path, data: bytes) -> None:
    write_atomically(path, lambda file: file.write(data))
