"""``ncrs render``: a champion's body, growth and one episode as pictures."""

from __future__ import annotations

import argparse
from pathlib import Path

from ncrs.commands import ROBOT_HELP, Commands, describe, output_folder, print_saved
from ncrs.runs.published import load_any_champion
from ncrs.viz.pictures import DEFAULT_SIZE, save_pictures


def add_parser(commands: Commands) -> None:
    """Declare the command."""
    parser = commands.add_parser(
        "render", help="draw the champion's body as a PNG and an episode as an animated GIF"
    )
    parser.add_argument("run", type=Path, metavar="ROBOT", help=ROBOT_HELP)
    parser.add_argument(
        "--size", type=int, default=DEFAULT_SIZE, help="side in pixels; default: %(default)s"
    )
    parser.add_argument("--seed", type=int, default=0, help="of the episode; default: 0")
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> None:
    champion = load_any_champion(options.run.as_posix())
    folder = output_folder(options.run)
    paths = save_pictures(champion, folder, seed=options.seed, size=options.size)
    print(describe(champion))
    print_saved(paths)
