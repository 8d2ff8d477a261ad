"""The command line, from its parsers."""

from __future__ import annotations

import argparse

from ncrs.cli import COMMANDS, TRAIN, build_parser


def commands() -> str:
    """List the commands, with what each does."""
    rows = [f"| [`ncrs {name}`](#ncrs-{name}) | {text} |" for name, text in COMMANDS.items()]
    return "\n".join(["| command | what it does |", "|---|---|", *rows])


def command_line() -> str:
    """Describe every command: its usage, and its arguments with their explanations."""
    return "\n".join(_command(name) for name in COMMANDS)


def _command(name: str) -> str:
    title = f"## ncrs {name}\n\n{COMMANDS[name][0].upper()}{COMMANDS[name][1:]}.\n"
    if name == TRAIN:
        return title
    parser = _subparsers(build_parser(name)).choices[name]
    usage = parser.format_usage().removeprefix("usage: ").rstrip()
    arguments = "\n".join(map(_argument, _arguments(parser)))
    return f"{title}\n```text\n{usage}\n```\n\n{arguments}"


def _subparsers(parser: argparse.ArgumentParser) -> argparse._SubParsersAction:
    (found,) = (item for item in parser._actions if isinstance(item, argparse._SubParsersAction))
    return found


def _arguments(parser: argparse.ArgumentParser) -> list[tuple[str, str]]:
    formatter = argparse.HelpFormatter(parser.prog)
    return [
        (formatter._format_action_invocation(action), _help(formatter, action))
        for action in parser._actions
        if action.dest != "help"
    ]


def _help(formatter: argparse.HelpFormatter, action: argparse.Action) -> str:
    if action.help:
        return formatter._expand_help(action)
    return f"One or more of {', '.join(action.choices)}; default: {' '.join(action.default)}"


def _argument(argument: tuple[str, str]) -> str:
    invocation, text = argument
    return f"`{invocation}`\n: {text[0].upper()}{text[1:]}\n"
