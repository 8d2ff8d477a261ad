"""``ncrs film``: growth and episodes of one robot as MP4 and GIF."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from ncrs.commands import Commands, output_folder, print_saved
from ncrs.runs.published import champion_path
from ncrs_envs.tasks import TASKS

if TYPE_CHECKING:
    from ncrs.viz.robots import EvolvedRobot

FORMATS = ("mp4", "gif")


def add_robot_arguments(parser: argparse.ArgumentParser, nargs: str | None = None) -> None:
    """Declare how to say which robot is meant."""
    parser.add_argument(
        "robot",
        type=Path,
        nargs=nargs,
        metavar="ROBOT",
        help="a run's folder, a champion's or archive's file, a genome (.npy, with --task), or the "
        "name of a published champion, such as light_chase/best",
    )
    parser.add_argument(
        "--measures",
        type=int,
        nargs=3,
        metavar=("SENSORS", "WHEELS", "CELLS"),
        help="the elite of the archive with these measures, instead of the champion",
    )
    parser.add_argument("--task", choices=sorted(TASKS), help="of a genome")
    parser.add_argument("--grid-size", type=int, help="of a genome's body; default: 5")


def given_robot(options: argparse.Namespace) -> EvolvedRobot:
    """The robot that the arguments say."""
    from ncrs.viz.robots import load_robot

    return load_robot(
        champion_path(options.robot),
        measures=options.measures,
        task=options.task,
        grid_size=options.grid_size,
    )


def add_parser(commands: Commands) -> None:
    """Declare the command."""
    parser = commands.add_parser("film", help="film a robot's growth and episodes (MP4 and GIF)")
    add_robot_arguments(parser)
    parser.add_argument("--out", type=Path, help="folder to write to; default: that of ROBOT")
    parser.add_argument("--name", default="film", help="of the files; default: %(default)s")
    parser.add_argument("--format", choices=FORMATS, nargs="+", default=list(FORMATS))
    parser.add_argument("--episodes", type=int, default=4, help="default: %(default)s")
    parser.add_argument("--seed", type=int, default=0, help="of the episodes; default: 0")
    parser.add_argument(
        "--speed", type=float, default=0.5, help="1 is real time; default: %(default)s"
    )
    parser.add_argument("--height", type=int, default=600, help="in pixels; default: %(default)s")
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> None:
    from ncrs.viz.films import save_film

    robot = given_robot(options)
    folder = output_folder(options.robot) if options.out is None else options.out
    paths = [folder / f"{options.name}.{kind}" for kind in dict.fromkeys(options.format)]
    save_film(
        robot,
        robot.title,
        paths,
        episodes=options.episodes,
        seed=options.seed,
        speed=options.speed,
        height=options.height,
    )
    print_saved(paths)
