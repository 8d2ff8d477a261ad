"""``ncrs evaluate``: test a champion on fresh episodes."""

from __future__ import annotations

import argparse
from pathlib import Path

from ncrs.commands import ROBOT_HELP, Commands, describe, output_folder, print_saved
from ncrs.engines.base import ENGINES
from ncrs.runs.assessment import EPISODES, REFERENCE_ENGINE, assess
from ncrs.runs.checkpoint import write_json
from ncrs.runs.published import load_any_champion

EVALUATION_FILE = "evaluation.json"


def add_parser(commands: Commands) -> None:
    """Declare the command."""
    parser = commands.add_parser(
        "evaluate", help="test the champion on fresh episodes and save the result as JSON"
    )
    parser.add_argument("run", type=Path, metavar="ROBOT", help=ROBOT_HELP)
    parser.add_argument("--episodes", type=int, default=EPISODES, help="default: %(default)s")
    parser.add_argument("--engine", choices=sorted(ENGINES), default=REFERENCE_ENGINE)
    parser.add_argument("--seed", type=int, default=0, help="of the episodes; default: 0")
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> None:
    champion = load_any_champion(options.run.as_posix())
    result = assess(champion, episodes=options.episodes, seed=options.seed, engine=options.engine)
    path = output_folder(options.run) / EVALUATION_FILE
    write_json(path, result.as_json())
    print(f"{describe(champion)}, {options.episodes} fresh episodes on {options.engine}:")
    print("\n".join("  " + line for line in result.lines()))
    print_saved([path])
