"""The robots of a page: published champions, or a run's champion and elites."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ncrs.automaton import chaser
from ncrs.automaton.growth import grow
from ncrs.automaton.nca import nca_of
from ncrs.live import DEFAULT_ELITES
from ncrs.runs.assessment import REFERENCE_ENGINE
from ncrs.runs.champion import CHAMPION_FILE, find_champion
from ncrs.runs.elites import ARCHIVE_FILE, Elite, EliteArchive, find_archive
from ncrs.runs.engine_settings import ConfigError
from ncrs.runs.published import PublishedChampion, champions, load_champion
from ncrs.runs.robot import EvolvedRobot
from ncrs_envs.errors import NCRSError
from ncrs_envs.tasks import BUILT_IN, TaskSettings


class LiveError(NCRSError, ValueError):
    """A page of live robots that cannot be made."""


@dataclass(frozen=True)
class LiveRobot:
    """A robot of a page, with what is known of it."""

    robot: EvolvedRobot
    fitness: float
    """Mean reward, NaN if unknown, as is the success."""
    success: float
    """Fraction of episodes."""
    episodes: int
    """Number of episodes behind both; 0 if unknown."""
    note: str
    """A sentence about where it comes from."""
    follows: bool = False
    """True if it drives on for as long as it is led; champions were chosen for short episodes."""


def live_robot(robot: EvolvedRobot) -> LiveRobot:
    """Collect what is known of a robot."""
    if isinstance(robot, PublishedChampion):
        test = robot.card["tests"][REFERENCE_ENGINE]
        success = test["success"]
        note = f"Found in generation {robot.generation:,}, tested on fresh courses with Box2D."
        return LiveRobot(robot, test["fitness"], success["fraction"], success["episodes"], note)
    if isinstance(robot, Elite):
        note = f"An elite, found in generation {robot.generation:,}."
        return LiveRobot(robot, robot.fitness, robot.success, robot.episodes, note)
    return LiveRobot(robot, robot.fitness, robot.success, 0, "")


def robot_by_hand() -> LiveRobot:
    """Make the chaser, which grows its body and follows the light for as long as that is moved."""
    genome, task = chaser.chaser_genome(), TaskSettings(chaser.TASK)
    body = grow(nca_of(genome, task.name), task.grid_size)
    fitness, success = chaser.FITNESS, chaser.SUCCESS
    robot = EvolvedRobot(genome, body, task, fitness, success, name="by_hand/chaser")
    note = "Its weights were wired by hand: it turns towards the light for as long as you lead it."
    return LiveRobot(robot, fitness, success, chaser.EPISODES, note, follows=True)


def published_robots() -> list[LiveRobot]:
    """Load all published champions, in the order of the tasks, the best of each first."""
    tasks = [task.name for task in BUILT_IN]
    robots = [load_champion(name) for name in champions()]
    return [live_robot(robot) for robot in sorted(robots, key=lambda r: tasks.index(r.task.name))]


def run_robots(run_dir: Path, elites: int = DEFAULT_ELITES) -> list[LiveRobot]:
    """Load a run's champion, and the fittest elites of as many ranges of size as are asked for.

    Args:
        run_dir: Folder of the run.
        elites: Maximum number of elites.

    Raises:
        LiveError: If the number is negative, or there is no robot to show.
        ConfigError: If the folder holds neither champion nor archive.
        CheckpointError: If a file of the run is damaged.
    """
    if elites < 0:
        raise LiveError(f"The number of elites must be 0 or more, got {elites}.")
    champion, archive = find_champion(run_dir), find_archive(run_dir)
    if champion is None and archive is None:
        raise ConfigError(
            f"{run_dir} holds neither {CHAMPION_FILE} nor {ARCHIVE_FILE}: give the folder of a run "
            "that has written a checkpoint."
        )
    found: list[EvolvedRobot] = [] if champion is None else [champion]
    if archive is not None:
        found += [archive.elite(measures) for measures in _spread(archive, elites)]
    if not found:
        raise LiveError(f"{run_dir} has no champion yet; ask for elites, or train for longer.")
    return [live_robot(robot) for robot in found]


def _spread(archive: EliteArchive, number: int) -> Sequence[tuple[int, int, int]]:
    """Return the measures of the fittest elites in ranges of size that hold equally many."""
    measures = archive.archive.measures
    fitness = archive.archive.column("fitness")
    order = np.lexsort(measures.T)
    ranges = [part for part in np.array_split(order, max(number, 1)) if len(part) and number]
    chosen = [part[np.argmax(fitness[part])] for part in ranges]
    return [(int(s), int(w), int(c)) for s, w, c in measures[chosen].tolist()] if chosen else []
