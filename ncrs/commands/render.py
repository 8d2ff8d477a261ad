"""``ncrs render``: a champion's body, growth and one episode as pictures."""

from __future__ import annotations

import argparse
from pathlib import Path

from ncrs.champion import load_champion_file
from ncrs.commands import Commands, describe, folder_of, print_saved
from ncrs.pictures import DEFAULT_SIZE, save_pictures


def add_parser(commands: Commands) -> None:
    """Declare the command."""
    parser = commands.add_parser(
        "render", help="draw the champion's body as a PNG and an episode as an animated GIF"
    )
    parser.add_argument("run", type=Path, metavar="RUN_DIR", help="a run's folder")
    parser.add_argument(
        "--size", type=int, default=DEFAULT_SIZE, help="side in pixels; default: %(default)s"
    )
    parser.add_argument("--seed", type=int, default=0, help="of the episode; default: 0")
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> None:
    champion = load_champion_file(options.run)
    folder = folder_of(options.run)
    paths = save_pictures(champion, folder, seed=options.seed, size=options.size)
    print(describe(champion))
    print_saved(paths)
