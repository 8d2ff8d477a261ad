"""``ncrs evaluate``: test a robot on fresh episodes."""

from __future__ import annotations

import argparse
from dataclasses import replace

from ncrs.commands import (
    ROBOTS_FOLDER,
    add_output_argument,
    add_perturbation_arguments,
    add_robot_arguments,
    add_seed_argument,
    describe,
    given_perturbations,
    given_robot,
    output_folder,
    print_saved,
)
from ncrs.engines.base import ENGINES
from ncrs.runs.assessment import (
    EPISODES,
    REFERENCE_ENGINE,
    assess,
    save_assessment,
)
from ncrs_envs.tasks import CONSTRUCTIONS


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
    parser.add_argument(
        "--construction",
        choices=CONSTRUCTIONS,
        help="construction of the robot, jointed on box2d alone; default: that of its task",
    )
    parser.add_argument(
        "--hull-density",
        type=float,
        metavar="DENSITY",
        help="density of all cells but the wheels, on box2d alone; default: that of its task",
    )
    add_seed_argument(parser)
    add_output_argument(parser, ROBOTS_FOLDER)
    add_perturbation_arguments(parser)
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> None:
    robot = given_robot(options)
    built = {
        name: value
        for name in ("construction", "hull_density")
        if (value := getattr(options, name)) is not None
    }
    robot = replace(robot, task=replace(robot.task, **built))
    perturbations = given_perturbations(options)
    result = assess(
        robot,
        episodes=options.episodes,
        seed=options.seed,
        engine=options.engine,
        perturbations=perturbations,
    )
    # The test of an elite, or of another construction, must not pass for the champion's.
    changes = [*(options.measures or ()), *built.values()]
    stem = "evaluation_perturbed" if perturbations.is_any else "evaluation"
    name = "_".join([stem, "-".join(map(str, changes))] if changes else [stem]) + ".json"
    path = save_assessment(result, output_folder(options, options.robot), name)
    where = ", ".join([options.engine, *(f"{key}={value}" for key, value in built.items())])
    print(f"{describe(robot)}, {options.episodes} fresh episodes on {where}:")
    print("\n".join("  " + line for line in result.lines()))
    print_saved([path])
