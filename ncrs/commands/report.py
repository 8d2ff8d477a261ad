"""``ncrs report``: a run as a page that opens in any browser."""

from __future__ import annotations

import argparse
from pathlib import Path

from ncrs.commands import Commands, add_seed_argument
from ncrs.report import REPORT_FOLDER, ReportOptions, build_report
from ncrs.report.build import ALL, CHAMPION

_DEFAULTS = ReportOptions()


def add_parser(commands: Commands) -> None:
    """Declare the command."""
    parser = commands.add_parser(
        "report", help="write a page that shows the run, its archive and its robots in a browser"
    )
    parser.add_argument("run", type=Path, metavar="RUN_DIR", help="a run's folder")
    parser.add_argument(
        "--output",
        type=Path,
        metavar="DIR",
        help=f"folder of the page; default: RUN_DIR/{REPORT_FOLDER}",
    )
    parser.add_argument(
        "--episodes",
        type=int,
        default=_DEFAULTS.episodes,
        help="number of episodes recorded for every robot; default: %(default)s",
    )
    parser.add_argument(
        "--elites",
        choices=(ALL, CHAMPION),
        default=_DEFAULTS.elites,
        help="robots whose growth, episodes and genomes to include; default: %(default)s",
    )
    add_seed_argument(parser, _DEFAULTS.seed)
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> None:
    from tqdm import tqdm

    chosen = ReportOptions(options.episodes, options.elites, options.seed)
    with tqdm(unit="robot", desc="Recording", leave=False, delay=1.0) as bar:

        def progress(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        report = build_report(options.run, options.output, chosen, progress=progress)
    print(
        f"{report.robots:,} robots, {report.recorded:,} with growth and episodes, "
        f"{report.size / 1e6:.1f} MB"
    )
    print(f"Saved {report.page}; open it in a browser. It needs no network.")
