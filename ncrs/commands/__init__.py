"""The subcommands of ``ncrs``, one file each: its arguments, and what it prints.

What needs time or optional packages to import is imported when a command runs.
"""

from __future__ import annotations

import argparse
import importlib.util
from pathlib import Path
from typing import TYPE_CHECKING

from ncrs.champion import Champion
from ncrs.settings import ConfigError

if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]
else:
    Commands = object


def folder_of(run: Path) -> Path:
    """The folder itself, or that of a file."""
    return run if run.is_dir() else run.parent


def print_saved(paths: list[Path]) -> None:
    """Say where files are."""
    for path in paths:
        print(f"Saved {path}")


def describe(champion: Champion) -> str:
    """Which champion it is, in a line."""
    return f"{champion.task.name}, champion of generation {champion.generation} ({champion.source})"


def require(package: str) -> None:
    """Raise ``ConfigError`` with what to do if an optional package is not installed."""
    if importlib.util.find_spec(package) is None:
        raise ConfigError(
            f"This command needs {package}, which is not installed: pip install 'ncrs[viz]'"
        )
