"""Runs in folders and sweeps, and their groups: runs that differ in their seeds alone."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs.runs.champion import Champion, find_champion
from ncrs.runs.elites import EliteArchive, find_archive
from ncrs.runs.engine_settings import ConfigError
from ncrs.runs.metrics import METRICS_FILE, read_metrics
from ncrs.runs.settings import (
    SETTINGS_FILE,
    TrainConfig,
    flat_settings,
    lasting_settings,
    load_config,
)
from ncrs_envs.tasks import TASKS

_SWEEP_DEPTHS = ("*/", "*/*/")
"""Patterns of runs in the folder of a sweep, or of several sweeps."""
_NUMBER = r"(\d+(?:\.\d+)?(?:e-?\d+)?)"
SEED, _TASK, _METHOD = "seed", "task.name", "optimizer.name"


@dataclass(frozen=True)
class Run:
    """A run's folder with its settings; the rest is read on demand."""

    folder: Path
    config: TrainConfig

    @property
    def task(self) -> str:
        """Name of the task."""
        return self.config.task.name

    @property
    def method(self) -> str:
        """Name of the optimizer."""
        return self.config.optimizer.name

    def settings(self) -> dict[str, Any]:
        """Return the settings that decide the run's course, by dotted name."""
        settings = flat_settings(lasting_settings(self.config))
        return {**settings, "generations": self.config.generations}

    def champion(self) -> Champion | None:
        """Load the champion; None if the run has none yet."""
        return find_champion(self.folder)

    def metrics(self) -> Mapping[str, NDArray[np.float64]] | None:
        """Read the curves by name; None if the run has no table of them."""
        return read_metrics(self.folder) if (self.folder / METRICS_FILE).is_file() else None

    def archive(self) -> EliteArchive | None:
        """Load the archive; None if the run has none, or an empty one."""
        archive = find_archive(self.folder)
        return archive if archive is not None and len(archive.archive) else None


@dataclass(frozen=True)
class Group:
    """Runs with the same settings, which differ in their seeds."""

    task: str
    method: str
    settings: Mapping[str, Any]
    """Other settings by which this group differs from those that it is compared with."""
    runs: Sequence[Run]

    @property
    def variant(self) -> str:
        """The other settings as text, such as "sigma 0.1, episodes 8"; "" without any."""
        return ", ".join(
            f"{name.rpartition('.')[2]} {setting_text(value)}"
            for name, value in self.settings.items()
        )

    @property
    def name(self) -> str:
        """Name of the group in file names."""
        variant = re.sub(r"[^\w.+-]+", "_", self.variant)
        return "_".join(filter(None, (self.task, self.method, variant)))

    def champions(self) -> list[tuple[Run, Champion]]:
        """Load the champions, each with its run, the fittest first."""
        found = [(run, run.champion()) for run in self.runs]
        having = [(run, champion) for run, champion in found if champion is not None]
        return sorted(having, key=lambda pair: -pair[1].fitness)


def setting_text(value: Any) -> str:
    """Format a setting's value as on the command line."""
    return value if isinstance(value, str) else json.dumps(value)


def find_folders(paths: Sequence[Path], files: Sequence[str] = (SETTINGS_FILE,)) -> list[Path]:
    """Find the folders of runs; a folder that is not a run, such as a sweep's, is searched.

    Args:
        paths: Folders of runs, or of sweeps.
        files: Names of files of which a run's folder has one.

    Raises:
        ConfigError: If a path is not a folder, or holds no run.
    """
    folders: list[Path] = []
    for path in paths:
        if not path.is_dir():
            raise ConfigError(f"{path} is not a folder: give the folder of a run, or of a sweep.")
        if any((path / name).is_file() for name in files):
            found = [path]
        else:
            inside = [
                f for depth in _SWEEP_DEPTHS for name in files for f in path.glob(depth + name)
            ]
            found = sorted({file.parent for file in inside}, key=_natural)
        if not found:
            raise ConfigError(
                f"{path} holds no run: there is no {files[0]} in it, nor in its folders."
            )
        folders += [folder for folder in found if folder not in folders]
    return folders


def _natural(folder: Path) -> list[Any]:
    """Return a key that sorts numbers in names by value."""
    parts = re.split(_NUMBER, str(folder))
    numbers = [float(part) for part in parts[1::2]]
    return [*zip(parts[::2], [*numbers, 0.0], strict=True)]


def find_runs(paths: Sequence[Path]) -> list[Run]:
    """Find the runs in folders, as ``find_folders`` does.

    Raises:
        ConfigError: If a path is not a folder or holds no run, or a run's settings are damaged.
    """
    return [Run(folder, load_config(folder)) for folder in find_folders(paths)]


def differing_settings(settings: Sequence[Mapping[str, Any]]) -> list[str]:
    """List the settings that differ among those that have them, task and method first."""
    names = list(dict.fromkeys(name for values in settings for name in values))
    names.sort(key=lambda name: (name != _TASK, name != _METHOD))
    return [
        name
        for name in names
        if len({setting_text(values[name]) for values in settings if name in values}) > 1
    ]


def group_runs(runs: Sequence[Run]) -> list[Group]:
    """Group runs by all settings but the seed.

    Returns:
        Groups with tasks in the paper's order, methods in alphabetical order, and settings in the
        order of the runs.
    """
    known = list(TASKS)
    members: dict[str, list[Run]] = {}
    for run in sorted(runs, key=lambda run: (known.index(run.task), run.method)):
        values = run.settings()
        del values[SEED]
        members.setdefault(json.dumps(values), []).append(run)
    settings = [group[0].settings() for group in members.values()]
    groups = []
    for (first, *rest), own in zip(members.values(), settings, strict=True):
        # Groups of other tasks or methods differ from this one by name already.
        rivals = [other for other in settings if (other[_TASK], other[_METHOD]) == _names(own)]
        varied = [name for name in differing_settings(rivals) if name != SEED]
        shown = {name: own[name] for name in varied}
        groups.append(Group(first.task, first.method, shown, [first, *rest]))
    return groups


def _names(settings: Mapping[str, Any]) -> tuple[str, str]:
    """Return the names of task and method among flat settings."""
    return settings[_TASK], settings[_METHOD]


def tasks_of(groups: Sequence[Group]) -> list[str]:
    """List the groups' tasks by name, each once."""
    return list(dict.fromkeys(group.task for group in groups))


def recipes_of(groups: Sequence[Group]) -> list[tuple[str, str]]:
    """List the groups' methods with their variants, each once, in alphabetical order of methods."""
    pairs = dict.fromkeys((group.method, group.variant) for group in groups)
    return sorted(pairs, key=lambda pair: pair[0])
