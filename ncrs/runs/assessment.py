"""Test a robot on fresh episodes, with confidence intervals."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ncrs.engines.base import make_engine, resolve_engine
from ncrs.runs.checkpoint import CheckpointError, write_json
from ncrs.runs.robot import EvolvedRobot
from ncrs.runs.seeds import Stream, seed_sequence
from ncrs.runs.statistics import NORMAL_95, wilson_interval
from ncrs_envs.body import body_to_characters
from ncrs_envs.mirroring import ScenarioSampling
from ncrs_envs.perturbing import NO_PERTURBATIONS, PerturbationSettings
from ncrs_envs.tasks import TaskSettings

EPISODES = 100
"""Number of fresh episodes in the paper's tests."""
_EPISODES_FOR_A_DECIMAL = 1000
"""Number of episodes from which on a tenth of a percent is worth printing."""
ASSESSMENT_FILE = "evaluation.json"
"""Name of the file in a run's folder with the result of the champion's last test."""
PERTURBED_FILE = "evaluation_perturbed.json"
"""Name of the file with the result of its last test under damage or noise."""
REFERENCE_ENGINE = "box2d"
"""Engine of champions' tests, whichever they evolved on: the reference physics."""


@dataclass(frozen=True)
class Proportion:
    """Number and fraction of episodes in which something happened."""

    count: int
    episodes: int
    fraction: float
    interval: tuple[float, float]
    """95 % Wilson interval of the fraction."""

    @classmethod
    def of(cls, count: int, episodes: int) -> Proportion:
        """Compute fraction and interval of a count."""
        return cls(count, episodes, count / episodes, wilson_interval(count, episodes))

    def percentages(self) -> tuple[str, str, str]:
        """Format the fraction and the ends of its interval, as precisely as the episodes allow."""
        digits = 0 if self.episodes < _EPISODES_FOR_A_DECIMAL else 1
        fraction, low, high = (f"{value:.{digits}%}" for value in (self.fraction, *self.interval))
        return fraction, low, high

    def __str__(self) -> str:
        fraction, low, high = self.percentages()
        interval = f"95 % interval {low} to {high}"
        return f"{self.count} of {self.episodes} episodes ({fraction}; {interval})"


@dataclass(frozen=True)
class Assessment:
    """Result of a test on fresh episodes."""

    task: str
    engine: str
    seed: int
    fitness: float
    fitness_standard_error: float
    success: Proportion
    crossed: Proportion | None
    """Episodes that crossed; None outside Obstacle."""
    body: str
    """The body as rows of characters."""
    genome: str = ""
    """Digest of the genome that was tested, see ``genome_digest``."""
    construction: str = TaskSettings.construction
    """Construction of the robot that was tested."""
    hull_density: float = TaskSettings.hull_density
    """Density of its hull."""
    perturbations: dict[str, Any] | None = None
    """What happened to the robot, see ``ncrs_envs.PerturbationSettings``; None for nothing."""
    recovered: float | None = None
    """Mean fraction of the lost modules that were back at the end; None if none could be lost."""

    def fitness_interval(self) -> tuple[float, float]:
        """Compute the 95 % interval of the mean fitness."""
        half = NORMAL_95 * self.fitness_standard_error
        return self.fitness - half, self.fitness + half

    def as_json(self) -> dict[str, Any]:
        """Return the result as JSON values."""
        return asdict(self)

    def lines(self) -> list[str]:
        """Format the result as lines of text."""
        lines = [
            f"fitness  {self.fitness:.4f} +- {self.fitness_standard_error:.4f} (standard error)",
            f"success  {self.success}",
        ]
        if self.crossed is not None:
            lines.append(f"crossed  {self.crossed}")
        if self.recovered is not None:
            lines.append(f"regrown  {self.recovered:.1%} of the lost modules")
        return lines


def assess(  # noqa: PLR0913 - keywords only
    robot: EvolvedRobot,
    *,
    episodes: int = EPISODES,
    seed: int = 0,
    engine: str = REFERENCE_ENGINE,
    workers: int | None = 1,
    perturbations: PerturbationSettings = NO_PERTURBATIONS,
) -> Assessment:
    """Test a robot on fresh episodes, in scenarios that no training run has seen.

    Args:
        robot: Robot whose genome is grown again for its task.
        episodes: Number of episodes, at least 1.
        seed: Seed for sampling the scenarios.
        engine: Name of an engine, as for ``evaluate``.
        workers: Number of processes or threads; one genome keeps one busy.
        perturbations: What happens to the robot; the placements do not depend on it.

    Raises:
        ScenarioError: If ``episodes`` is not a positive integer.
        SeedError: If ``seed`` is not a non-negative integer.
        EngineSettingError: If there is no such engine, or it cannot use the task's settings.
    """
    settings = robot.task
    sequence = seed_sequence(seed, Stream.ASSESSMENT)
    sampling = ScenarioSampling(perturbations=perturbations)
    scenarios = sampling.draw(settings.task, sequence, episodes, settings.grid_size)
    engine = resolve_engine(engine, settings, perturbations.is_any)
    with make_engine(engine, settings, workers) as running:
        result = running.evaluate(robot.genome, scenarios)
    struck = np.array([scenario.damage is not None for scenario in scenarios])
    episode_fitness = result.episode_fitness[0]
    spread = float(episode_fitness.std(ddof=1)) if episodes > 1 else 0.0
    crossed = Proportion.of(int(result.crossed[0].sum()), episodes)
    return Assessment(
        task=settings.task.name,
        engine=engine,
        seed=seed,
        fitness=float(episode_fitness.mean()),
        fitness_standard_error=spread / float(np.sqrt(episodes)),
        success=Proportion.of(int(result.success[0].sum()), episodes),
        crossed=crossed if settings.task.has_walls else None,
        body=body_to_characters(result.bodies[0]),
        genome=genome_digest(robot),
        construction=settings.construction,
        hull_density=settings.hull_density,
        perturbations=asdict(perturbations) if perturbations.is_any else None,
        recovered=float(result.recovered[0, struck].mean()) if struck.any() else None,
    )


def genome_digest(robot: EvolvedRobot) -> str:
    """Return a digest of a robot's genome, by which a test is known to be of it."""
    return hashlib.sha256(np.ascontiguousarray(robot.genome).tobytes()).hexdigest()[:16]


def save_assessment(assessment: Assessment, folder: Path, name: str = ASSESSMENT_FILE) -> Path:
    """Write the result of a test into a folder and return the file's path.

    Raises:
        CheckpointError: If it cannot be written.
    """
    path = folder / name
    write_json(path, assessment.as_json())
    return path


def find_assessment(folder: Path, robot: EvolvedRobot | None) -> Assessment | None:
    """Read the result of a robot's test in a folder.

    Args:
        folder: Folder of a run.
        robot: Robot whose test is wanted; None without one.

    Returns:
        The test; None if there is none, or it is of another robot, or another construction or
        density of it, or not on the reference engine.

    Raises:
        CheckpointError: If the file holds something else.
    """
    path = folder / ASSESSMENT_FILE
    if robot is None or not path.is_file():
        return None
    try:
        values: Mapping[str, Any] = json.loads(path.read_text())
        success, crossed = values["success"], values["crossed"]
        found = Assessment(
            **{
                **values,
                "success": Proportion.of(success["count"], success["episodes"]),
                "crossed": crossed and Proportion.of(crossed["count"], crossed["episodes"]),
            }
        )
    except (ValueError, KeyError, TypeError) as error:
        raise CheckpointError(
            f"{path} does not hold the result of a test: {error}. Write it again "
            "with ncrs evaluate."
        ) from error
    task = robot.task
    tested = (found.genome, found.engine, found.construction, found.hull_density)
    wanted = (genome_digest(robot), REFERENCE_ENGINE, task.construction, task.hull_density)
    return found if tested == wanted else None
