"""The robots that a report shows: a run's elites, and its champion after them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs.evolution.archive import Archive
from ncrs.runs.assessment import assess
from ncrs.runs.champion import CHAMPION_FILE, Champion, find_champion
from ncrs.runs.elites import ARCHIVE_FILE, Elite, EliteArchive, find_archive, make_archive
from ncrs.runs.engine_settings import ConfigError
from ncrs.runs.robot import EvolvedRobot
from ncrs_envs.errors import NCRSError
from ncrs_envs.tasks import TaskSettings


class ReportError(NCRSError, ValueError):
    """A report that cannot be made, or not in that folder."""


@dataclass(frozen=True)
class Robots:
    """R robots of one task: the archive's elites in its order, then the champion if there is one.

    The champion stands apart even if it is an elite too, since its fitness was measured on other
    scenarios.
    """

    task: TaskSettings
    archive: Archive
    """Archive of the run; empty if it has no elites."""
    elite_episodes: int
    """Number of episodes behind an elite's fitness; 0 without an archive."""
    champion: Champion | None
    genomes: NDArray[np.float32]
    """Genomes, ``(R, N)``."""
    bodies: NDArray[np.int8]
    """Cell codes of the bodies, ``(R, n, n)``."""
    measures: NDArray[np.int64]
    """Numbers of sensors, wheels and cells, ``(R, 3)``."""
    fitness: NDArray[np.float64]
    """Fitness, ``(R,)``; the next two have the same shape."""
    success: NDArray[np.float64]
    generations: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.fitness)

    @property
    def elites(self) -> int:
        """Number of elites among the robots."""
        return len(self.archive)


def load_robots(run_dir: Path) -> Robots:
    """Load a run's archive and champion.

    Raises:
        ConfigError: If the folder holds neither.
        ReportError: If they hold no robot, or are of different tasks.
        CheckpointError: If a file is damaged.
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
    """Put the elites and the champion into one table.

    Raises:
        ReportError: If neither is given.
    """
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


def lone_robot(robot: EvolvedRobot) -> Robots:
    """Make the table of one robot; a genome of unknown fitness is tested on fresh episodes."""
    fitness, success = robot.fitness, robot.success
    if math.isnan(fitness):
        test = assess(robot)
        fitness, success = test.fitness, test.success.fraction
    champion = Champion(
        genome=robot.genome,
        body=robot.body,
        task=robot.task,
        fitness=fitness,
        success=success,
        name=robot.title,
        generation=getattr(robot, "generation", 0),
        source=getattr(robot, "source", "elite" if isinstance(robot, Elite) else "genome"),
    )
    return gather_robots(None, champion)


def _task_of(champion: Champion | None) -> TaskSettings:
    if champion is None:
        raise ReportError("There is neither an archive nor a champion to report on.")
    return champion.task
