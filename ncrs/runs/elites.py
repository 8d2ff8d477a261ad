"""A run's archive: its file, and its elites as robots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from ncrs.automaton.channels import nca_layout
from ncrs.engines.base import AUTO_ENGINE, Evaluation
from ncrs.engines.evaluate import evaluate
from ncrs.evolution.archive import NO_CELL, Archive, MeasureSpace
from ncrs.runs.checkpoint import CheckpointError, read_state, write_state
from ncrs.runs.robot import EvolvedRobot
from ncrs.runs.seeds import row_numbers, row_sequence, training_generation
from ncrs.runs.settings import run_file
from ncrs_envs.body import Cell, parse_body
from ncrs_envs.errors import NCRSError
from ncrs_envs.mirroring import PLAIN_SAMPLING, ScenarioSampling, sampling_of
from ncrs_envs.scenario import Scenario
from ncrs_envs.tasks import Task, TaskSettings

ARCHIVE_FILE = "archive.npz"
_NEAREST = 5


class EliteError(NCRSError, LookupError, ValueError):
    """A measure triple that no body can have, or that has no elite."""


def measure_space(task: Task, grid_size: int) -> MeasureSpace:
    """Return the measure triples that valid bodies of a task can have."""
    wheels = sum(count for cell, count in task.required_parts if cell is Cell.WHEEL)
    return MeasureSpace(task.min_sensors, wheels, grid_size**2)


def make_archive(settings: TaskSettings) -> Archive:
    """Make an empty archive for a task."""
    space = measure_space(settings.task, settings.grid_size)
    return Archive(space, nca_layout(settings.task).num_parameters, settings.grid_size)


@dataclass(frozen=True, eq=False)
class Elite(EvolvedRobot):
    """The best robot known with its measures.

    Its fitness is a lucky draw, unless the archive was re-estimated.
    """

    generation: int
    """Index of the generation that found it."""
    evaluation_seed: tuple[int, ...]
    """Seed and keys of its scenarios' random stream."""
    episodes: int
    """Number of its scenarios."""
    sampling: ScenarioSampling = PLAIN_SAMPLING
    """Sampling of its scenarios."""

    @property
    def title(self) -> str:
        """Name of the robot for display."""
        return f"elite with measures {self.measures}"

    @property
    def scenarios(self) -> list[Scenario]:
        """The scenarios in which it earned its fitness."""
        sequence = row_sequence(self.evaluation_seed)
        return self.sampling.draw(
            self.task.name,
            sequence,
            self.episodes,
            self.task.grid_size,
            training_generation(self.evaluation_seed),
        )

    def evaluate(self, engine: str = AUTO_ENGINE) -> Evaluation:
        """Evaluate it in its scenarios again; the engine that found it gives the same fitness."""
        return evaluate(
            self.genome,
            self.task.name,
            engine=engine,
            scenarios=self.scenarios,
            grid_size=self.task.grid_size,
            distance_score=self.task.distance_score,
            success_radius=self.task.success_radius,
            construction=self.task.construction,
            hull_density=self.task.hull_density,
        )


@dataclass(frozen=True)
class EliteArchive:
    """An archive with its task, and the scenarios of its elites' evaluation."""

    task: TaskSettings
    archive: Archive
    episodes: int
    """Number of scenarios behind each elite's fitness."""
    sampling: ScenarioSampling = PLAIN_SAMPLING
    """Sampling of these scenarios."""

    def elite(self, measures: Sequence[int]) -> Elite:
        """Return the elite with these measures: sensors, wheels, cells.

        Raises:
            EliteError: If there is none. The message names the nearest elites.
        """
        wanted = np.asarray(measures)
        if wanted.shape != (3,) or not np.issubdtype(wanted.dtype, np.integer):
            raise EliteError(
                f"measures must be three integers, (sensors, wheels, cells), got {measures!r}."
            )
        archive = self.archive
        cell = int(archive.space.cells(wanted[None])[0])
        triple = (int(wanted[0]), int(wanted[1]), int(wanted[2]))
        row = np.flatnonzero(archive.cells == cell)
        if not len(row):
            raise EliteError(self._missing(triple, possible=cell != NO_CELL))
        index = int(row[0])
        return Elite(
            genome=archive.column("genomes")[index],
            body=parse_body(archive.column("bodies")[index], archive.grid_size),
            task=self.task,
            fitness=float(archive.column("fitness")[index]),
            success=float(archive.column("success")[index]),
            generation=int(archive.column("generations")[index]),
            evaluation_seed=row_numbers(archive.column("seeds")[index]),
            episodes=self.episodes,
            sampling=self.sampling,
        )

    def _missing(self, triple: tuple[int, int, int], *, possible: bool) -> str:
        space, filled = self.archive.space, self.archive.measures
        reason = (
            "is empty"
            if possible
            else f"is impossible: at least {space.min_sensors} sensors and {space.min_wheels} "
            f"wheels, and sensors + wheels <= cells <= {space.max_cells}"
        )
        order = np.argsort(np.abs(filled - triple).sum(axis=1), kind="stable")
        nearest = [tuple(row) for row in filled[order[:_NEAREST]].tolist()]
        known = f"the nearest filled are {nearest}" if nearest else "the archive has no elites"
        return f"(sensors, wheels, cells) = {triple} {reason}; {known}."

    def save(self, path: Path) -> None:
        """Write to one file, atomically; ``load_archive`` reads it without pickle."""
        state = {
            "task": asdict(self.task),
            "episodes": self.episodes,
            "sampling": asdict(self.sampling),
            "archive": self.archive.state(),
        }
        write_state(path, state)


def load_archive(path: str | Path) -> EliteArchive:
    """Load an archive from a run's folder or from an archive's file.

    Raises:
        ConfigError: If there is neither.
        CheckpointError: If the file is damaged, or holds something else.
    """
    path = run_file(
        path,
        ARCHIVE_FILE,
        "give the folder of a run that has written a checkpoint, or an archive's file.",
    )
    state = read_state(path)
    try:
        task = TaskSettings(**state["task"])
        loaded = EliteArchive(
            task,
            Archive.from_state(state["archive"]),
            int(state["episodes"]),
            sampling_of(state["sampling"]),
        )
        expected = make_archive(task)
    except (TypeError, KeyError, ValueError) as error:
        raise CheckpointError(f"{path} does not hold an archive: {error}") from error
    if expected.space != loaded.archive.space or expected.dimension != loaded.archive.dimension:
        raise CheckpointError(f"{path} holds an archive that does not fit its task {task.name}.")
    return loaded


def find_archive(run_dir: Path) -> EliteArchive | None:
    """Load the archive of a run; None if it has none. See ``load_archive`` for errors."""
    return load_archive(run_dir) if (run_dir / ARCHIVE_FILE).is_file() else None


def load_elite(path: str | Path, measures: Sequence[int]) -> Elite:
    """Load one elite: its NCA, body, genome, task and fitness.

    Args:
        path: Folder of a run, or an archive's file.
        measures: Number of sensors of all types, of wheels, and of occupied cells.

    Raises:
        EliteError: If there is no such elite. The message names the nearest elites.
        ConfigError: If there is no such file.
        CheckpointError: If the file is damaged, or holds something else.
    """
    return load_archive(path).elite(measures)
