"""The robots that a report shows: a run's elites, and its champion after them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs.evolution.archive import Archive
from ncrs.runs.champion import CHAMPION_FILE, Champion, find_champion
from ncrs.runs.elites import ARCHIVE_FILE, EliteArchive, find_archive, make_archive
from ncrs.runs.settings import ConfigError
from ncrs_envs.errors import NCRSError
from ncrs_envs.tasks import TaskSettings


class ReportError(NCRSError, ValueError):
    """A report that cannot be made, or not where it was asked for."""


@dataclass(frozen=True)
class Robots:
    """R robots of one task: the archive's elites in its order, then the champion if there is one.

    The champion stands apart even if it is an elite too, since its fitness was measured on other
    scenarios.
    """

    task: TaskSettings
    archive: Archive
    """Empty for runs without elites."""
    elite_episodes: int
    """Scenarios behind an elite's fitness; 0 without an archive."""
    champion: Champion | None
    genomes: NDArray[np.float32]
    """Shape ``(R, N)``."""
    bodies: NDArray[np.int8]
    """Cell codes, ``(R, n, n)``."""
    measures: NDArray[np.int64]
    """Sensors, wheels, cells; ``(R, 3)``."""
    fitness: NDArray[np.float64]
    """Shape ``(R,)``; so are the next two."""
    success: NDArray[np.float64]
    generations: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.fitness)

    @property
    def elites(self) -> int:
        """Number of robots that are the archive's."""
        return len(self.archive)


def load_robots(run_dir: Path) -> Robots:
    """Load a run's archive and champion.

    Raises:
        ConfigError: the folder holds neither.
        ReportError: both are there, but no robot in them; or they are of different tasks.
        CheckpointError: a file is damaged.
    """
    archive, champion = find_archive(run_dir), find_champion(run_dir)
    if archive is None and champion is None:
        raise ConfigError(
            f"{run_dir} holds neither {ARCHIVE_FILE} nor {CHAMPION_FILE}: give the folder of a run "
            "that has written a checkpoint."
        )
    if archive is not None and champion is not None and archive.task != champion.task:
        raise ReportError(
            f"{run_dir} holds an archive for {archive.task} and a champion for {champion.task}; "
            "both must be of the same run."
        )
    robots = gather_robots(archive, champion)
    if not len(robots):
        raise ReportError(f"{run_dir} holds no robot yet: its archive is empty. Train for longer.")
    return robots


def gather_robots(archive: EliteArchive | None, champion: Champion | None) -> Robots:
    """Put the elites and the champion into one table; at least one of the two must be given."""
    task = archive.task if archive is not None else _task_of(champion)
    elites = make_archive(task) if archive is None else archive.archive
    columns: dict[str, NDArray[Any]] = {
        name: elites.column(name)
        for name in ("genomes", "bodies", "fitness", "success", "generations")
    }
    measures = elites.measures
    if champion is not None:
        last = {
            "genomes": champion.genome,
            "bodies": champion.body,
            "fitness": champion.fitness,
            "success": champion.success,
            "generations": champion.generation,
        }
        columns = {
            name: np.concatenate([column, np.asarray(last[name], dtype=column.dtype)[None]])
            for name, column in columns.items()
        }
        measures = np.concatenate([measures, [champion.measures]])
    return Robots(
        task=task,
        archive=elites,
        elite_episodes=0 if archive is None else archive.episodes,
        champion=champion,
        measures=measures,
        **columns,
    )


def _task_of(champion: Champion | None) -> TaskSettings:
    if champion is None:
        raise ReportError("There is neither an archive nor a champion to report on.")
    return champion.task
