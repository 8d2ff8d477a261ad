"""``ncrs live``: one page in which robots grow and drive, in any browser."""

from __future__ import annotations

import argparse
from pathlib import Path

from ncrs.commands import add_robot_arguments, add_seed_argument, given_robot, output_folder
from ncrs.live.robots import DEFAULT_ELITES


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_robot_arguments(parser, nargs="?")
    parser.add_argument(
        "--elites",
        type=int,
        default=DEFAULT_ELITES,
        help="number of a run's elites beside its champion; default: %(default)s",
    )
    parser.add_argument(
        "--output",
        type=Path,
        metavar="FILE",
        help="page to write; default: live.html in the run's folder, in a new one of the robot's "
        "name, or here",
    )
    add_seed_argument(parser)
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> None:
    from ncrs.live.build import PAGE_FILE, write_page
    from ncrs.live.robots import live_robot, published_robots, robot_by_hand, run_robots

    path: Path = options.output or Path(PAGE_FILE)
    if options.robot is None:
        robots = [robot_by_hand(), *published_robots()]
    elif options.robot.is_dir() and options.measures is None:
        robots = run_robots(options.robot, options.elites)
        path = options.output or options.robot / PAGE_FILE
    else:
        robots = [live_robot(given_robot(options))]
        path = options.output or output_folder(options, options.robot) / PAGE_FILE
    page = write_page(path, robots, options.seed)
    counted = f"{page.robots:,} robot{'s' if page.robots > 1 else ''}"
    print(f"{counted}, {page.size / 1e3:.0f} kB")
    print(f"Saved {page.path}; open it in a browser. It needs no network.")
