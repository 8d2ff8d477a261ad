"""``ncrs evaluate``: test a robot on fresh episodes."""

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
from ncrs.engines.base import ENGINES
from ncrs.runs.assessment import (
    ASSESSMENT_FILE,
    EPISODES,
    REFERENCE_ENGINE,
    assess,
    save_assessment,
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_robot_arguments(parser)
    parser.add_argument(
        "--episodes",
        type=int,
        default=EPISODES,
        help="number of fresh episodes; default: %(default)s",
    )
    parser.add_argument("--engine", choices=sorted(ENGINES), default=REFERENCE_ENGINE)
    add_seed_argument(parser)
    add_output_argument(parser, ROBOTS_FOLDER)
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> None:
    robot = given_robot(options)
    result = assess(robot, episodes=options.episodes, seed=options.seed, engine=options.engine)
    name = ASSESSMENT_FILE
    if options.measures is not None:  # an elite's test must not pass for the champion's
        name = f"evaluation_{'-'.join(map(str, options.measures))}.json"
    path = save_assessment(result, output_folder(options, options.robot), name)
    print(f"{describe(robot)}, {options.episodes} fresh episodes on {options.engine}:")
    print("\n".join("  " + line for line in result.lines()))
    print_saved([path])
