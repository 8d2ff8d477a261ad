"""``ncrs figures``: figures for print, from one run or a comparison of several."""

from __future__ import annotations

import argparse
from pathlib import Path

from ncrs.commands import Commands, print_saved, require

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
        choices=("generation", "evaluations"),
        default="generation",
        help="what fitness is plotted over; default: %(default)s",
    )
    parser.add_argument(
        "--episodes", type=int, default=12, help="whose last positions are shown; default: 12"
    )
    parser.add_argument("--seed", type=int, default=0, help="of the episodes; default: 0")
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> None:
    require("matplotlib")
    from ncrs.viz.figures import save_figures

    folder = options.runs[0] / FOLDER if options.out is None else options.out
    print_saved(
        save_figures(
            options.runs,
            folder,
            axis=options.axis,
            episodes=options.episodes,
            seed=options.seed,
        )
    )
