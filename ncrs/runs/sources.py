"""Load a robot from a run, a file, or the package."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.growth import grow
from ncrs.automaton.nca import nca_of
from ncrs.runs.champion import CHAMPION_FILE, load_champion_file
from ncrs.runs.checkpoint import ForeignFileError, read_state
from ncrs.runs.elites import load_elite
from ncrs.runs.published import champions, load_champion
from ncrs.runs.robot import EvolvedRobot
from ncrs.runs.settings import load_config
from ncrs_envs.body import DEFAULT_GRID_SIZE, BodyError
from ncrs_envs.errors import NCRSError
from ncrs_envs.tasks import TaskSettings

GENOME_SUFFIX = ".npy"
RECORD_SUFFIX = ".json"
"""Suffix of a genome with its task, as a report's page saves it."""
_STATE_SUFFIX = ".npz"
"""Suffix of champions and archives, which may be renamed."""
_FILES = (
    f"give a genome as {GENOME_SUFFIX} or as a report's {RECORD_SUFFIX}, or the {_STATE_SUFFIX} of "
    "a champion or an archive."
)


class SourceError(NCRSError, LookupError, ValueError):
    """A source that holds no robot, or options that do not fit what it holds."""


def is_genome_file(source: str | Path) -> bool:
    """Tell whether a source is a file with a genome alone, which needs a task."""
    path = Path(source)
    return path.suffix.lower() == GENOME_SUFFIX and path.is_file()


def load_robot(
    source: str | Path,
    *,
    measures: Sequence[int] | None = None,
    task: str | None = None,
    grid_size: int | None = None,
) -> EvolvedRobot:
    """Load a champion, an elite, or a genome, which is grown.

    Args:
        source: Folder of a run, a champion's file, an archive's file (with ``measures``), a genome
            as ``.npy`` (with ``task``) or as the ``.json`` that a report saves; or, if there is no
            such path, the name of a published champion.
        measures: Sensors, wheels and cells of an elite, instead of the champion.
        task: Task of a genome in ``.npy``; other sources have their own.
        grid_size: Side of the body of a genome in ``.npy``; None for the default.

    Raises:
        SourceError: If there is no such path or name, the file holds no robot, the run has no
            champion, or an option is missing or does not apply to the source.
        ConfigError: If the folder holds no run.
        EliteError: If there is no elite with these measures.
        GenomeError: If the genome in the file is not one of the task.
        TaskError: If the task is unknown, or a setting of it is out of range.
        BodyError: If the genome grows a body that the task cannot use.
        CheckpointError: If a file is damaged.
        InstallationError: If there is no such path, and the installation has no champions.
    """
    path = Path(source)
    if not path.exists() and path.as_posix() not in champions():
        raise SourceError(
            f"{source} does not exist: give a run's folder, a file of a robot, or the name of a "
            f"published champion, one of {champions()}."
        )
    suffix = path.suffix.lower() if path.is_file() else ""
    known = suffix in (GENOME_SUFFIX, RECORD_SUFFIX, _STATE_SUFFIX)
    if path.is_file() and not known and not zipfile.is_zipfile(path):
        raise SourceError(f"{source} is no file of a robot: {_FILES}")
    is_genome = is_genome_file(path)
    if not is_genome and (task is not None or grid_size is not None):
        raise SourceError(
            f"A task and a grid size are for genomes in {GENOME_SUFFIX}; {source} has its own."
        )
    if measures is not None and (suffix in (GENOME_SUFFIX, RECORD_SUFFIX) or not path.exists()):
        raise SourceError(f"{source} is not a run or an archive; measures choose from those.")
    if not path.exists():
        return load_champion(path.as_posix())
    if is_genome:
        return _from_genome(path, task, grid_size)
    if suffix == RECORD_SUFFIX:
        return _from_record(path)
    if path.is_file():
        _check_contents(path, wants_elite=measures is not None)
    if measures is not None:
        return load_elite(path, measures)
    if path.is_dir() and not (path / CHAMPION_FILE).is_file():
        every = load_config(path).champion_every
        raise SourceError(
            f"The run in {path} has no champion yet: it gets one after {every} generations, once a "
            "genome grows a body that the task can use."
        )
    return load_champion_file(path)


def _check_contents(path: Path, *, wants_elite: bool) -> None:
    """Raise ``SourceError`` if a whole file holds something else than is wanted."""
    try:
        found = read_state(path).keys()
    except ForeignFileError as error:
        raise SourceError(f"{error} To use a genome, {_FILES}") from error
    if "archive" in found and not wants_elite:
        raise SourceError(
            f"{path} holds an archive: choose an elite by its measures, as in --measures 2 8 25."
        )
    if "genome" in found and wants_elite:
        raise SourceError(
            f"{path} holds a champion alone: leave out the measures, or give an archive or a run."
        )


def _from_genome(path: Path, task: str | None, grid_size: int | None) -> EvolvedRobot:
    if task is None:
        raise SourceError(f"{path} holds only a genome: name its task, as in --task obstacle.")
    settings = TaskSettings(task, DEFAULT_GRID_SIZE if grid_size is None else grid_size)
    try:
        genome = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise SourceError(f"{path} is not a numpy file: {error}.") from error
    if not isinstance(genome, np.ndarray):
        raise SourceError(f"{path} is not a single array, but an .npz of another name: {_FILES}")
    return _grown(path, genome, settings)


def _from_record(path: Path) -> EvolvedRobot:
    """Read a genome with its task from the JSON that a report's page saves."""
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise SourceError(f"{path} is not a JSON file: {error}.") from error
    missing = sorted({"task", "genome"} - set(record if isinstance(record, Mapping) else ()))
    if missing:
        raise SourceError(
            f"{path} holds no robot: it lacks {' and '.join(missing)}, which the {RECORD_SUFFIX} "
            f"of a report has; {_FILES}"
        )
    try:
        settings = TaskSettings(
            record["task"],
            record.get("grid_size", DEFAULT_GRID_SIZE),
            record.get("distance_score", TaskSettings.distance_score),
            record.get("success_radius"),
        )
        fitness, success = (_number(record.get(name)) for name in ("fitness", "success"))
    except TypeError as error:
        raise SourceError(f"{path} holds no robot: {error}.") from error
    if settings.success_radius == settings.task.success_radius:
        settings.success_radius = None  # the report writes it in full
    return _grown(path, record["genome"], settings, fitness, success)


def _number(value: Any) -> float:
    """Return a JSON number; NaN for null."""
    if value is None:
        return np.nan
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"fitness and success must be numbers, got {value!r}")
    return float(value)


def _grown(
    path: Path,
    genome: NDArray[Any] | list[float],
    settings: TaskSettings,
    fitness: float = np.nan,
    success: float = np.nan,
) -> EvolvedRobot:
    nca = nca_of(genome, settings.task)
    body = grow(nca, settings.grid_size)
    try:
        return EvolvedRobot(nca.genome(), body, settings, fitness, success, name=path.stem)
    except BodyError as error:
        raise BodyError(f"The genome in {path} grows no robot that can drive: {error}") from error
