"""The subcommands of ``ncrs``, one file each: its arguments, and what it prints.

What needs time or optional packages to import is imported when a command runs.
"""

from __future__ import annotations

import argparse
import importlib.util
from pathlib import Path
from typing import TYPE_CHECKING

from ncrs.runs.champion import Champion
from ncrs.runs.published import champion_path, file_stem
from ncrs.runs.settings import ConfigError

if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]
else:
    Commands = object


ROBOT_HELP = "a run's folder, a champion's file, or the name of one, such as light_chase/best"


def folder_of(run: Path) -> Path:
    """The folder itself, or that of a file."""
    return run if run.is_dir() else run.parent


def output_folder(source: Path) -> Path:
    """Where to write what is made of a robot: into its run's folder, or beside its file; of a
    published champion into a folder of its name, which is made here."""
    if champion_path(source) == source:
        return folder_of(source)
    folder = Path(file_stem(source.as_posix()))
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise ConfigError(f"Cannot make the folder {folder}: {error.strerror or error}.") from error
    return folder


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
