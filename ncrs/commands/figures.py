"""``ncrs figures``: figures for print, from one run or a comparison of several."""

from __future__ import annotations

import argparse
from pathlib import Path

from ncrs.commands import (
    add_output_argument,
    add_seed_argument,
    output_folder,
    print_saved,
    progress_bar,
    require,
)
from ncrs.viz.options import AXES, FigureOptions

_DEFAULTS = FigureOptions()
FOLDER = "figures"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "runs", type=Path, nargs="+", metavar="RUN_DIR", help="folders of runs, or of sweeps"
    )
    add_output_argument(parser, f"{FOLDER} in the first RUN_DIR")
    parser.add_argument(
        "--axis",
        choices=tuple(AXES),
        default=_DEFAULTS.axis,
        help="horizontal axis of the fitness curves; default: %(default)s",
    )
    parser.add_argument(
        "--episodes",
        type=int,
        default=_DEFAULTS.episodes,
        help="number of episodes whose last positions are shown; default: %(default)s",
    )
    add_seed_argument(parser, _DEFAULTS.seed)
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> None:
    require("matplotlib")
    from ncrs.viz.figures import save_figures

    folder = output_folder(options, options.runs[0]) if options.output else options.runs[0] / FOLDER
    chosen = FigureOptions(options.axis, options.episodes, options.seed)
    with progress_bar("Drawing", "figure") as progress:
        paths = save_figures(options.runs, folder, chosen, progress)
    print_saved(paths)
