"""Load a robot from a run, a file, or the package."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ncrs.automaton.growth import grow
from ncrs.automaton.nca import NCA
from ncrs.runs.champion import CHAMPION_FILE, load_champion_file
from ncrs.runs.elites import load_elite
from ncrs.runs.published import champions, load_champion
from ncrs.runs.robot import EvolvedRobot
from ncrs.runs.settings import load_config
from ncrs_envs.body import DEFAULT_GRID_SIZE, BodyError
from ncrs_envs.errors import NCRSError
from ncrs_envs.tasks import TaskSettings

GENOME_SUFFIX = ".npy"


class SourceError(NCRSError, LookupError, ValueError):
    """A source that holds no robot, or options that do not fit what it holds."""


def load_robot(
    source: str | Path,
    *,
    measures: Sequence[int] | None = None,
    task: str | None = None,
    grid_size: int | None = None,
) -> EvolvedRobot:
    """Load a champion, an elite, or a genome, which is grown.

    Args:
        source: Folder of a run, a champion's file, an archive's file (with ``measures``), or a
            genome as ``.npy`` (with ``task``); or, if there is no such path, the name of a
            published champion.
        measures: Sensors, wheels and cells of an elite, instead of the champion.
        task: Task of a genome; other sources have their own.
        grid_size: Side of a genome's body; None for the default.

    Raises:
        SourceError: If there is no such path or name, the run has no champion, or an option is
            missing or does not apply to the source.
        ConfigError: If the folder holds no run.
        EliteError: If there is no elite with these measures.
        GenomeError: If the file holds no genome of the task.
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
    is_genome = path.exists() and path.suffix == GENOME_SUFFIX
    if not is_genome and (task is not None or grid_size is not None):
        raise SourceError(
            f"A task and a grid size are for genomes ({GENOME_SUFFIX}); {source} has its own."
        )
    if measures is not None and (is_genome or not path.exists()):
        raise SourceError(f"{source} is not a run or an archive; measures choose from those.")
    if not path.exists():
        return load_champion(path.as_posix())
    if is_genome:
        return _from_genome(path, task, grid_size)
    if measures is not None:
        return load_elite(path, measures)
    if path.is_dir() and not (path / CHAMPION_FILE).is_file():
        every = load_config(path).champion_every
        raise SourceError(
            f"The run in {path} has no champion yet: it gets one after {every} generations, once a "
            "genome grows a body that the task can use."
        )
    return load_champion_file(path)


def _from_genome(path: Path, task: str | None, grid_size: int | None) -> EvolvedRobot:
    if task is None:
        raise SourceError(f"{path} holds only a genome: name its task, as in --task obstacle.")
    settings = TaskSettings(task, DEFAULT_GRID_SIZE if grid_size is None else grid_size)
    try:
        genome = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise SourceError(f"{path} is not a numpy file: {error}.") from error
    nca = NCA(settings.task).set_genome(genome)
    body = grow(nca, settings.grid_size)
    try:
        return EvolvedRobot(nca.genome(), body, settings, np.nan, np.nan, name=path.stem)
    except BodyError as error:
        raise BodyError(f"The genome in {path} grows no robot that can drive: {error}") from error
