"""``ncrs champions``: the robots that come with the package."""

from __future__ import annotations

import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> None:
    from ncrs.runs.published import champions, load_champion
    from ncrs.runs.tables import text_table

    rows = []
    for name in champions():
        champion = load_champion(name)
        test = champion.card["tests"]["box2d"]
        sensors, wheels, cells = champion.measures
        success, episodes = test["success"]["fraction"], test["success"]["episodes"]
        rows.append(
            [name, f"{test['fitness']:.3f}", f"{success:.1%} of {episodes:,}"]
            + [str(cells), str(wheels), str(sensors)]
        )
    columns = ["champion", "fitness", "success", "cells", "wheels", "sensors"]
    print("\n".join(text_table(columns, rows)))
