"""Runs in folders and sweeps, and their groups for comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ncrs.runs.champion import Champion, find_champion
from ncrs.runs.elites import EliteArchive, find_archive
from ncrs.runs.metrics import METRICS_FILE, read_metrics
from ncrs.runs.settings import SETTINGS_FILE, TrainConfig, load_config
from ncrs_envs.errors import NCRSError
from ncrs_envs.tasks import TASKS

_SWEEP_DEPTHS = ("*/", "*/*/")
"""Patterns of runs in the folder of a sweep, or of several sweeps."""


class VizError(NCRSError, ValueError):
    """Nothing to show: no run, a run without results, or a missing package or encoder."""


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
    """Runs of one task with one method, which differ in their seeds."""

    task: str
    method: str
    runs: Sequence[Run]

    @property
    def name(self) -> str:
        """Name of the group in file names."""
        return f"{self.task}_{self.method}"

    def champions(self) -> list[tuple[Run, Champion]]:
        """Load the champions, each with its run, the fittest first."""
        found = [(run, run.champion()) for run in self.runs]
        having = [(run, champion) for run, champion in found if champion is not None]
        return sorted(having, key=lambda pair: -pair[1].fitness)


def find_runs(paths: Sequence[Path]) -> list[Run]:
    """Find the runs in folders; a folder that is not a run, such as a sweep's, is searched.

    Raises:
        VizError: If a path is not a folder, or holds no run.
        ConfigError: If a run's settings are damaged.
    """
    folders: list[Path] = []
    for path in paths:
        if not path.is_dir():
            raise VizError(f"{path} is not a folder: give the folder of a run, or of a sweep.")
        if (path / SETTINGS_FILE).is_file():
            found = [path]
        else:
            files = [file for depth in _SWEEP_DEPTHS for file in path.glob(depth + SETTINGS_FILE)]
            found = sorted(file.parent for file in files)
        if not found:
            raise VizError(
                f"{path} holds no run: there is no {SETTINGS_FILE} in it, nor in its folders."
            )
        folders += [folder for folder in found if folder not in folders]
    return [Run(folder, load_config(folder)) for folder in folders]


def group_runs(runs: Sequence[Run]) -> list[Group]:
    """Group runs by task and method: tasks in the paper's order, methods in alphabetical order."""
    groups: dict[tuple[str, str], list[Run]] = {}
    order = list(TASKS)
    for run in sorted(runs, key=lambda run: (order.index(run.task), run.method)):
        groups.setdefault((run.task, run.method), []).append(run)
    return [Group(task, method, members) for (task, method), members in groups.items()]


def tasks_of(groups: Sequence[Group]) -> list[str]:
    """List the groups' tasks by name, each once."""
    return list(dict.fromkeys(group.task for group in groups))


def methods_of(groups: Sequence[Group]) -> list[str]:
    """List the groups' methods by name, each once."""
    return sorted({group.method for group in groups})
