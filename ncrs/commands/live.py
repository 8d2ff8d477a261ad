"""``ncrs live``: one page in which robots grow and drive, in any browser."""

from __future__ import annotations

import argparse
from pathlib import Path

from ncrs.commands import (
    ROBOTS_FOLDER,
    add_output_argument,
    add_robot_arguments,
    add_seed_argument,
    given_robot,
    output_folder,
)
from ncrs.live import DEFAULT_ELITES


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_robot_arguments(parser, nargs="?")
    parser.add_argument(
        "--elites",
        type=int,
        default=DEFAULT_ELITES,
        help="maximum number of a run's elites beside its champion; default: %(default)s",
    )
    add_output_argument(parser, f"{ROBOTS_FOLDER}; without ROBOT, here")
    add_seed_argument(parser)
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> None:
    from ncrs.live.build import PAGE_FILE, write_page
    from ncrs.live.robots import live_robot, published_robots, robot_by_hand, run_robots

    source: Path | None = options.robot
    if source is None:
        robots = [robot_by_hand(), *published_robots()]
    elif source.is_dir() and options.measures is None:
        robots = run_robots(source, options.elites)
    else:
        robots = [live_robot(given_robot(options))]
    folder = output_folder(options, Path() if source is None else source)
    page = write_page(folder / PAGE_FILE, robots, options.seed)
    counted = f"{page.robots:,} robot{'s' if page.robots > 1 else ''}"
    print(f"{counted}, {page.size / 1e3:.0f} kB")
    print(f"Saved {page.path}; open it in a browser. It needs no network.")
