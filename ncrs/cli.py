"""Evolve robots with one neural cellular automaton; test, draw and film them."""

from __future__ import annotations

import argparse
import importlib
import os
import signal
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

from ncrs import __version__

TRAIN = "train"
COMMANDS: Mapping[str, str] = {
    TRAIN: "evolve a robot, or sweep over settings; `ncrs train --help` lists them",
    "results": "print and save the results of runs and sweeps, with statistics over seeds",
    "champions": "list the robots that come with the package",
    "evaluate": "test a robot on fresh episodes and save the result as JSON",
    "archive": "summarise the archive; estimate its elites again, or export it",
    "render": "draw a robot's body and growth as PNGs and episodes as an animated GIF",
    "figures": "draw figures for print (PNG, SVG and CSV), of one run or comparing several",
    "film": "film a robot's growth and episodes (MP4 and GIF)",
    "play": "drive a body with the keyboard and edit it with the mouse, in a window",
    "live": "write a page in which robots grow and drive live, in any browser",
    "report": "write a page that shows a run, its archive and its robots in a browser",
}
"""Names of the commands, with what each does."""


def build_parser(chosen: str | None) -> argparse.ArgumentParser:
    """Build the parser with the arguments of the chosen command; no other module is imported."""
    parser = argparse.ArgumentParser(prog="ncrs", description=__doc__)
    parser.add_argument("--version", action="version", version=f"ncrs {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for name, text in COMMANDS.items():
        command = commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
        if name == chosen:
            importlib.import_module(f"ncrs.commands.{name}").add_arguments(command)
    return parser


@contextmanager
def _ends_quietly() -> Iterator[None]:
    """End the process without a traceback if Ctrl-C, or the end of a reader, ends the block."""
    try:
        yield
        sys.stdout.flush()
    except KeyboardInterrupt:
        # As the signal itself would end it: a shell ends its loop, too.
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        signal.raise_signal(signal.SIGINT)
    except BrokenPipeError:
        # Python would complain at exit, when it flushes what nobody reads.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(1) from None


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; bad input ends with one sentence and exit code 2."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    with _ends_quietly():
        _run(words)


def _run(words: list[str]) -> None:
    if words[:1] == ["-sc"]:  # the shell's completion of `ncrs train` leaves out the command
        os.environ["COMP_LINE"] = os.environ.get("COMP_LINE", "").replace(f" {TRAIN} ", " ", 1)
        words = [TRAIN, *words]
    chosen = words[0] if words and words[0] in COMMANDS else None
    if chosen == TRAIN:
        # Hydra reads its own arguments.
        from ncrs.training.launch import launch

        launch(words[1:])
        return
    try:
        options = build_parser(chosen).parse_args(words)
        options.action(options)
    except Exception as error:
        from ncrs_envs.errors import NCRSError  # slow to import: not before --help is answered

        if not isinstance(error, NCRSError):
            raise
        print(f"ncrs: {error}", file=sys.stderr)
        raise SystemExit(2) from error
