"""The ``ncrs`` command: look at what a run found."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from ncrs.assessment import EPISODES, REFERENCE_ENGINE, assess
from ncrs.champion import Champion, load_champion_file
from ncrs.checkpoint import CheckpointError, write_json
from ncrs.engines.base import ENGINES
from ncrs.pictures import DEFAULT_SIZE, save_pictures

EVALUATION_FILE = "evaluation.json"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="ncrs", description=__doc__)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    evaluate = commands.add_parser(
        "evaluate", help="test the champion on fresh episodes and save the result as JSON"
    )
    evaluate.add_argument("--episodes", type=int, default=EPISODES, help="default: %(default)s")
    evaluate.add_argument("--engine", choices=sorted(ENGINES), default=REFERENCE_ENGINE)
    evaluate.set_defaults(action=_evaluate)

    render = commands.add_parser(
        "render", help="draw the champion's body as a PNG and an episode as an animated GIF"
    )
    render.add_argument(
        "--size", type=int, default=DEFAULT_SIZE, help="side in pixels; default: %(default)s"
    )
    render.set_defaults(action=_render)

    for command in (evaluate, render):
        command.add_argument("run", type=Path, metavar="RUN_DIR", help="a run's folder")
        command.add_argument("--seed", type=int, default=0, help="of the episodes; default: 0")
    return parser


def _folder(run: Path) -> Path:
    return run if run.is_dir() else run.parent


def _describe(champion: Champion) -> str:
    return f"{champion.task.name}, champion of generation {champion.generation} ({champion.source})"


def _evaluate(options: argparse.Namespace) -> None:
    champion = load_champion_file(options.run)
    result = assess(champion, episodes=options.episodes, seed=options.seed, engine=options.engine)
    path = _folder(options.run) / EVALUATION_FILE
    write_json(path, result.as_json())
    print(f"{_describe(champion)}, {options.episodes} fresh episodes on {options.engine}:")
    print("\n".join("  " + line for line in result.lines()))
    print(f"Saved {path}")


def _render(options: argparse.Namespace) -> None:
    champion = load_champion_file(options.run)
    paths = save_pictures(champion, _folder(options.run), seed=options.seed, size=options.size)
    print(f"{_describe(champion)}")
    for path in paths:
        print(f"Saved {path}")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; bad input ends with one sentence and exit code 2."""
    options = _parser().parse_args(arguments)
    try:
        options.action(options)
    except (ValueError, CheckpointError) as error:
        print(f"ncrs: {error}", file=sys.stderr)
        raise SystemExit(2) from error
