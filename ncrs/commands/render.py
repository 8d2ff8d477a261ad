"""``ncrs render``: a robot's body, growth and episodes as pictures."""

from __future__ import annotations

import argparse

from ncrs.commands import (
    ROBOTS_FOLDER,
    add_output_argument,
    add_robot_arguments,
    add_seed_argument,
    describe,
    given_robot,
    output_folder,
    print_saved,
)
from ncrs.viz.pictures import DEFAULT_SIZE, save_pictures


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_robot_arguments(parser)
    parser.add_argument(
        "--size", type=int, default=DEFAULT_SIZE, help="side in pixels; default: %(default)s"
    )
    add_seed_argument(parser)
    add_output_argument(parser, ROBOTS_FOLDER)
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> None:
    robot = given_robot(options)
    folder = output_folder(options, options.robot)
    paths = save_pictures(robot, folder, seed=options.seed, size=options.size)
    print(describe(robot))
    print_saved(paths)
