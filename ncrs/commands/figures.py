"""``ncrs figures``: figures for print, from one run or a comparison of several."""

from __future__ import annotations

import argparse
from pathlib import Path

from ncrs.commands import Commands, add_seed_argument, print_saved, require
from ncrs.viz.options import AXES, FigureOptions

_DEFAULTS = FigureOptions()
FOLDER = "figures"


def add_parser(commands: Commands) -> None:
    """Declare the command."""
    parser = commands.add_parser(
        "figures", help="draw figures for print (PNG, SVG and CSV), of one run or comparing several"
    )
    parser.add_argument(
        "runs", type=Path, nargs="+", metavar="RUN_DIR", help="folders of runs, or of sweeps"
    )
    parser.add_argument(
        "--out", type=Path, help=f"folder to write to; default: {FOLDER} in the first RUN_DIR"
    )
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

    folder = options.runs[0] / FOLDER if options.out is None else options.out
    chosen = FigureOptions(options.axis, options.episodes, options.seed)
    print_saved(save_figures(options.runs, folder, chosen))
