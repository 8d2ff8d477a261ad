"""The subcommands of ``ncrs``, one file each: its arguments, and its output.

Modules that are slow to import, or need optional packages, are imported when a command runs.
"""

from __future__ import annotations

import argparse
import importlib.util
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, get_args, get_type_hints

from ncrs_envs.perturbing import PerturbationSettings
from ncrs_envs.tasks import TASKS

if TYPE_CHECKING:
    from ncrs.runs.robot import EvolvedRobot

_OF_TRAINING = ("damage_generations", "share")
"""Settings of perturbations that are for training alone."""


def add_robot_arguments(parser: argparse.ArgumentParser, nargs: str | None = None) -> None:
    """Declare the arguments that choose a robot."""
    parser.add_argument(
        "robot",
        type=Path,
        nargs=nargs,
        metavar="ROBOT",
        help="a run's folder, a champion's or archive's file, a genome (.npy with --task, or a "
        "report's .json), or the name of a published champion, such as light_chase/best",
    )
    parser.add_argument(
        "--measures",
        type=int,
        nargs=3,
        metavar=("SENSORS", "WHEELS", "CELLS"),
        help="the elite of the archive with these measures, instead of the champion",
    )
    parser.add_argument("--task", choices=sorted(TASKS), help="task of a genome (.npy)")
    parser.add_argument("--grid-size", type=int, help="side of a genome's body; default: 5")


def add_seed_argument(parser: argparse.ArgumentParser, default: int = 0) -> None:
    """Declare the seed of fresh episodes."""
    parser.add_argument(
        "--seed",
        type=int,
        default=default,
        help="seed for sampling the scenarios; default: %(default)s",
    )


def add_perturbation_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what happens to the robot: damage, failing wheels, noise, repair."""
    from ncrs.training.explanations import explanations

    group = parser.add_argument_group("damage, failing wheels, noise and repair")
    hints = get_type_hints(PerturbationSettings)
    for item in fields(PerturbationSettings):
        if item.name in _OF_TRAINING:
            continue
        kinds = get_args(hints[item.name]) or (hints[item.name],)
        group.add_argument(
            f"--{item.name.replace('_', '-')}",
            type=kinds[0],
            default=item.default,
            metavar=kinds[0].__name__.upper(),
            help=explanations(PerturbationSettings)[item.name].text.replace("%", "%%"),
        )


def given_perturbations(options: argparse.Namespace) -> PerturbationSettings:
    """Return the perturbations that the arguments choose.

    Raises:
        PerturbationError: If one is out of range.
    """
    names = [item.name for item in fields(PerturbationSettings) if item.name not in _OF_TRAINING]
    return PerturbationSettings(**{name: getattr(options, name) for name in names})


def given_robot(options: argparse.Namespace) -> EvolvedRobot:
    """Load the robot that the arguments choose."""
    from ncrs.runs.sources import load_robot

    return load_robot(
        options.robot,
        measures=options.measures,
        task=options.task,
        grid_size=options.grid_size,
    )


def folder_of(run: Path) -> Path:
    """Return the folder itself, or the folder of a file."""
    return run if run.is_dir() else run.parent


def add_output_argument(parser: argparse.ArgumentParser, default: str) -> None:
    """Declare the folder to write to.

    Args:
        parser: Parser of the command.
        default: Folder to which the command writes without the argument, for the help.
    """
    parser.add_argument(
        "--output", type=Path, metavar="DIR", help=f"folder to write to; default: {default}"
    )


ROBOTS_FOLDER = "that of ROBOT, or a new one of the champion's name"
"""Default folder of commands that take a robot, for their help."""


def output_folder(options: argparse.Namespace, source: Path) -> Path:
    """Return the folder for a command's files, made if missing.

    Args:
        options: Options of the command, with ``output``.
        source: The robot or the run: without ``--output`` the files go to its own folder, or those
            of a published champion to a new folder of its name.

    Raises:
        CheckpointError: If the folder cannot be made.
    """
    from ncrs.runs.checkpoint import writing
    from ncrs.runs.published import file_stem

    if options.output is not None:
        folder = Path(options.output)
    elif source.exists():
        folder = folder_of(source)
    else:
        folder = Path(file_stem(source.as_posix()))
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def print_saved(paths: list[Path]) -> None:
    """Print the paths of files that were written."""
    for path in paths:
        print(f"Saved {path}")


def describe(robot: EvolvedRobot) -> str:
    """Format the task and the name of a robot, in one line."""
    return f"{robot.task.name}, {robot.title}"


@contextmanager
def progress_bar(description: str, unit: str) -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar on stderr if the block takes longer than a second.

    Args:
        description: Work that is done.
        unit: Name of one piece of it.

    Yields:
        Function to call with the number of pieces done, and the number of all.
    """
    from tqdm import tqdm

    with tqdm(unit=unit, desc=description, leave=False, delay=1.0) as bar:

        def progress(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        yield progress


def require(package: str) -> None:
    """Raise ``ConfigError`` if an optional package is not installed."""
    if importlib.util.find_spec(package) is None:
        from ncrs.runs.engine_settings import ConfigError

        raise ConfigError(
            f"This command needs {package}, which is not installed: pip install 'ncrs[viz]'"
        )
