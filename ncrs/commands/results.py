"""``ncrs results``: the table of runs and sweeps, with aggregates over seeds."""

from __future__ import annotations

import argparse
from pathlib import Path

from ncrs.commands import add_output_argument, output_folder, print_saved


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "runs", type=Path, nargs="+", metavar="RUN_DIR", help="folders of runs, or of sweeps"
    )
    add_output_argument(parser, "the first RUN_DIR")
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> None:
    from ncrs.runs.results import collect_results, save_results

    results = collect_results(options.runs)
    print("\n".join(results.lines()))
    print_saved(save_results(results, output_folder(options, options.runs[0])))
