"""``ncrs play``: drive a body with the keyboard, alone or beside an evolved robot."""

from __future__ import annotations

import argparse

from ncrs.commands import add_robot_arguments, add_seed_argument, given_robot


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_robot_arguments(parser, nargs="?")
    parser.add_argument("--body", help="body that you start with, rows joined by /: L#L/W#W/W#W")
    add_seed_argument(parser)
    parser.add_argument(
        "--endless", action="store_true", help="keep driving after the task's 100 steps"
    )
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> None:
    from ncrs.viz.play_session import PlaySession
    from ncrs.viz.play_window import PlayWindow
    from ncrs_envs.body import DEFAULT_GRID_SIZE, parse_body
    from ncrs_envs.tasks import LIGHT_CHASE, TaskSettings, default_body

    rival = None
    if options.robot is None:
        name = options.task or LIGHT_CHASE.name
        task = TaskSettings(name, options.grid_size or DEFAULT_GRID_SIZE)
    else:
        rival = given_robot(options)
        task = rival.task
    if options.body is None:
        body = default_body(task.task, task.grid_size)
    else:
        body = parse_body(options.body, task.grid_size)
    session = PlaySession(task, body, rival, seed=options.seed, endless=options.endless)
    with PlayWindow(session, "evolved" if rival is None else rival.title) as window:
        window.run()
