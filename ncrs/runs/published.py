"""The robots that come with the package: the best of each published run, ready to drive."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ncrs.runs.champion import Champion, load_champion_file
from ncrs.runs.checkpoint import CheckpointError
from ncrs.runs.resources import resource_folder
from ncrs_envs.errors import NCRSError

CHAMPION_SUFFIX, CARD_SUFFIX, PICTURE_SUFFIX = ".npz", ".json", ".png"


class ChampionError(NCRSError, LookupError, ValueError):
    """No champion of that name comes with the package."""


@dataclass(frozen=True, eq=False)
class PublishedChampion(Champion):
    """A champion with the record of its training and its tests."""

    card: dict[str, Any] = field(kw_only=True)
    """The record: the "commands" that trained it, one after the other, the "config" of the last,
    and "generations", "evaluations" and "env_steps" of all; the genome's "generation" and "source",
    as in ``Champion``; under "tests" the result on 1,000 fresh episodes on each engine, see
    ``ncrs.runs.assessment.Assessment``; and statistics of the run's "archive", see
    ``ncrs.evolution.archive.Archive.statistics``."""


def file_stem(name: str) -> str:
    """Return the name of a champion's files without suffix, such as "light_chase-best"."""
    return name.replace("/", "-")


def champions_folder() -> Path:
    """Return the folder of the champions' files; raise ``InstallationError`` if it is missing."""
    return resource_folder("champions")


def champion_file(name: str) -> Path:
    """Return the file of a champion that ``champions()`` lists."""
    return champions_folder() / f"{file_stem(name)}{CHAMPION_SUFFIX}"


def champions() -> list[str]:
    """List the names that ``load_champion`` takes, in alphabetical order."""
    paths = champions_folder().glob(f"*{CARD_SUFFIX}")
    whole = [path.stem for path in paths if path.with_suffix(CHAMPION_SUFFIX).is_file()]
    return sorted(stem.replace("-", "/") for stem in whole)


def load_champion(name: str) -> PublishedChampion:
    """Load a champion that comes with the package.

    Args:
        name: Task and recipe, such as "light_chase/best"; ``champions()`` lists all.

    Returns:
        The robot, with ``nca``, ``body``, ``genome``, ``task``, and the ``card`` with its tests.

    Raises:
        ChampionError: If there is none of that name.
        CheckpointError: If its files are damaged.
    """
    if name not in champions():
        raise ChampionError(f"There is no champion {name!r}; choose one of {champions()}.")
    file = champion_file(name)
    champion = load_champion_file(file)
    try:
        card = json.loads(file.with_suffix(CARD_SUFFIX).read_text())
    except ValueError as error:
        raise CheckpointError(f"The card of {name} is not valid JSON: {error}.") from error
    return PublishedChampion(**{**vars(champion), "name": name}, card=card)
