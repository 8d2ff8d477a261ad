"""An evolved robot from a run, an archive, or a file with a genome."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.growth import grow
from ncrs.automaton.nca import NCA
from ncrs.runs.champion import CHAMPION_FILE, load_champion_file
from ncrs.runs.elites import load_elite
from ncrs.runs.settings import SETTINGS_FILE, load_config
from ncrs.viz.runs import VizError
from ncrs_envs.body import BodyError
from ncrs_envs.tasks import TaskSettings

_GENOME_SUFFIX = ".npy"


@dataclass(frozen=True, eq=False)
class EvolvedRobot:
    """A grown robot with a title."""

    nca: NCA
    body: NDArray[np.int8]
    """Cell codes, ``(n, n)``; one that the task can use."""
    task: TaskSettings
    title: str


def load_robot(
    path: Path,
    *,
    measures: Sequence[int] | None = None,
    task: str | None = None,
    grid_size: int | None = None,
) -> EvolvedRobot:
    """Load a champion, an elite, or a genome, and grow it where it has no body yet.

    Args:
        path: a run's folder, a champion's file, an archive's file (with ``measures``), or a
            genome as ``.npy`` (with ``task``).
        measures: sensors, wheels and cells of an elite.
        task: of a genome; the other files say theirs.
        grid_size: of a genome's body; None for the usual one.

    Raises:
        VizError: no such path, a run without a champion, or arguments that the file does not need
            or lacks.
        EliteError: no elite with these measures.
        GenomeError: a file that holds no genome of the task.
        BodyError: the genome grows a body that the task cannot use.
        CheckpointError: a damaged file.
    """
    if not path.exists():
        raise VizError(f"{path} does not exist: give a run's folder, or a file of a robot.")
    if path.suffix == _GENOME_SUFFIX:
        if measures is not None:
            raise VizError(f"{path} holds one genome; measures choose from an archive.")
        return _from_genome(path, task, grid_size)
    if task is not None or grid_size is not None:
        raise VizError(f"A task and a grid size are for genomes (.npy); {path} says its own.")
    if measures is not None:
        elite = load_elite(path, measures)
        title = f"elite with measures {elite.measures}"
        return EvolvedRobot(elite.nca, elite.body, elite.task, title)
    if path.is_dir() and not (path / CHAMPION_FILE).is_file():
        if not (path / SETTINGS_FILE).is_file():
            raise VizError(f"{path} holds no run: there is no {SETTINGS_FILE} in it.")
        done = load_config(path).champion_every
        raise VizError(
            f"The run in {path} has no champion yet: it gets one after {done} generations, once a "
            "genome grows a body that the task can use."
        )
    champion = load_champion_file(path)
    title = f"champion of generation {champion.generation}"
    return EvolvedRobot(champion.nca, champion.body, champion.task, title)


def _from_genome(path: Path, task: str | None, grid_size: int | None) -> EvolvedRobot:
    if task is None:
        raise VizError(f"{path} holds a genome alone: say what it is for, as in --task obstacle.")
    settings = TaskSettings(name=task)
    if grid_size is not None:
        settings = TaskSettings(name=task, grid_size=grid_size)
    kind = settings.task
    try:
        genome = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise VizError(f"{path} is not a file of numpy: {error}.") from error
    nca = NCA(kind).set_genome(genome)
    body = grow(nca, settings.grid_size)
    try:
        kind.check_body(body)
    except BodyError as error:
        raise BodyError(f"The genome in {path} grows no robot that can drive: {error}") from error
    return EvolvedRobot(nca, body, settings, path.stem)
