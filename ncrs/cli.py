"""The ``ncrs`` command: test, draw and film the robots of a run."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from ncrs.commands import archive, evaluate, figures, film, play, render, report
from ncrs_envs.errors import NCRSError

_COMMANDS = (evaluate, archive, render, figures, film, play, report)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="ncrs", description=__doc__)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for command in _COMMANDS:
        command.add_parser(commands)
    return parser


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; bad input ends with one sentence and exit code 2."""
    options = _parser().parse_args(arguments)
    try:
        options.action(options)
    except NCRSError as error:
        print(f"ncrs: {error}", file=sys.stderr)
        raise SystemExit(2) from error
