"""``ncrs report``: a run as a page that opens in any browser."""

from __future__ import annotations

import argparse

from ncrs.commands import (
    add_output_argument,
    add_robot_arguments,
    add_seed_argument,
    given_robot,
    output_folder,
    progress_bar,
)
from ncrs.report import (
    REPORT_FOLDER,
    Report,
    ReportOptions,
    build_report,
    build_robot_report,
)
from ncrs.report.build import ALL, CHAMPION

_DEFAULTS = ReportOptions()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_robot_arguments(parser)
    add_output_argument(
        parser, f"{REPORT_FOLDER} in the run's, or in a new one of the robot's name"
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
    chosen = ReportOptions(options.episodes, options.elites, options.seed)
    if options.measures is not None or not options.robot.is_dir():
        robot = given_robot(options)
        folder = options.output or output_folder(options, options.robot) / REPORT_FOLDER
        _print_saved(build_robot_report(robot, folder, chosen))
        return
    with progress_bar("Recording", "robot") as progress:
        report = build_report(options.robot, options.output, chosen, progress=progress)
    _print_saved(report)


def _print_saved(report: Report) -> None:
    robots = f"{report.robots:,} robot{'s' if report.robots > 1 else ''}"
    size = f"{report.size / 1e6:.1f} MB"
    print(f"{robots}, {report.recorded:,} with growth and episodes, {size}")
    print(f"Saved {report.page}; open it in a browser. It needs no network.")
