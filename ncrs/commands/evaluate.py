"""``ncrs evaluate``: test a robot on fresh episodes."""

from __future__ import annotations

import argparse

from ncrs.commands import (
    Commands,
    add_robot_arguments,
    add_seed_argument,
    describe,
    given_robot,
    output_folder,
    print_saved,
)
from ncrs.engines.base import ENGINES
from ncrs.runs.assessment import EPISODES, REFERENCE_ENGINE, assess
from ncrs.runs.checkpoint import write_json

EVALUATION_FILE = "evaluation.json"


def add_parser(commands: Commands) -> None:
    """Declare the command."""
    parser = commands.add_parser(
        "evaluate", help="test a robot on fresh episodes and save the result as JSON"
    )
    add_robot_arguments(parser)
    parser.add_argument(
        "--episodes",
        type=int,
        default=EPISODES,
        help="number of fresh episodes; default: %(default)s",
    )
    parser.add_argument("--engine", choices=sorted(ENGINES), default=REFERENCE_ENGINE)
    add_seed_argument(parser)
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> None:
    robot = given_robot(options)
    result = assess(robot, episodes=options.episodes, seed=options.seed, engine=options.engine)
    path = output_folder(options.robot) / EVALUATION_FILE
    write_json(path, result.as_json())
    print(f"{describe(robot)}, {options.episodes} fresh episodes on {options.engine}:")
    print("\n".join("  " + line for line in result.lines()))
    print_saved([path])
