"""``ncrs film``: growth and episodes of one robot as MP4 and GIF."""

from __future__ import annotations

import argparse

from ncrs.commands import (
    ROBOTS_FOLDER,
    add_output_argument,
    add_perturbation_arguments,
    add_robot_arguments,
    add_seed_argument,
    given_perturbations,
    given_robot,
    output_folder,
    print_saved,
    progress_bar,
)
from ncrs.viz.options import FilmOptions

FORMATS = ("mp4", "gif")
_DEFAULTS = FilmOptions()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_robot_arguments(parser)
    add_output_argument(parser, ROBOTS_FOLDER)
    parser.add_argument("--name", default="film", help="name of the files; default: %(default)s")
    parser.add_argument("--format", choices=FORMATS, nargs="+", default=list(FORMATS))
    parser.add_argument(
        "--episodes",
        type=int,
        default=_DEFAULTS.episodes,
        help="number of episodes; default: %(default)s",
    )
    add_seed_argument(parser, _DEFAULTS.seed)
    parser.add_argument(
        "--speed",
        type=float,
        default=_DEFAULTS.speed,
        help="speed of the film, 1 is real time; default: %(default)s",
    )
    parser.add_argument(
        "--height",
        type=int,
        default=_DEFAULTS.height,
        help="height in pixels; default: %(default)s",
    )
    add_perturbation_arguments(parser)
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> None:
    from ncrs.viz.films import save_film

    film = FilmOptions(
        options.episodes,
        options.seed,
        options.speed,
        options.height,
        given_perturbations(options),
    )
    robot = given_robot(options)
    folder = output_folder(options, options.robot)
    paths = [folder / f"{options.name}.{kind}" for kind in dict.fromkeys(options.format)]
    with progress_bar("Filming", "frame") as progress:
        save_film(robot, paths, film, progress)
    print_saved(paths)
