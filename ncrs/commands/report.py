"""``ncrs report``: a run as a page that opens in any browser."""

from __future__ import annotations

import argparse
from pathlib import Path

from ncrs.commands import Commands


def add_parser(commands: Commands) -> None:
    """Declare the command."""
    parser = commands.add_parser(
        "report", help="write a page that shows the run, its archive and its robots in a browser"
    )
    parser.add_argument("run", type=Path, metavar="RUN_DIR", help="a run's folder")
    parser.add_argument(
        "--output", type=Path, metavar="DIR", help="the page's folder; default: RUN_DIR/report"
    )
    parser.add_argument(
        "--episodes", type=int, default=2, help="recorded for every robot; default: %(default)s"
    )
    parser.add_argument(
        "--elites",
        choices=("all", "champion"),
        default="all",
        help="whose growth, episodes and genomes to include; default: %(default)s",
    )
    parser.add_argument("--seed", type=int, default=0, help="of the episodes; default: 0")
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> None:
    from tqdm import tqdm

    from ncrs.report import build_report

    with tqdm(unit="robot", desc="Recording", leave=False, delay=1.0) as bar:

        def progress(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        report = build_report(
            options.run,
            options.output,
            episodes=options.episodes,
            elites=options.elites,
            seed=options.seed,
            progress=progress,
        )
    print(
        f"{report.robots:,} robots, {report.recorded:,} with growth and episodes, "
        f"{report.size / 1e6:.1f} MB"
    )
    print(f"Saved {report.page}; open it in a browser, it needs no network.")
