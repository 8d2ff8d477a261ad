"""The space of a search, and the genome that it starts from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import NCALayout, nca_layout
from ncrs.automaton.transfer import transferred
from ncrs.evolution.space import SPACES, WEIGHTS, SearchSpace, SpaceError
from ncrs.runs.engine_settings import ConfigError
from ncrs.runs.settings import TrainConfig
from ncrs.runs.sources import SourceError, is_genome_file, load_robot
from ncrs_envs.tasks import TaskSettings

_TOLERANCE = 1e-5


def search_space(config: TrainConfig) -> SearchSpace:
    """Make the search space of a run, at its start.

    Raises:
        ConfigError: If the space does not fit the task or ``start_from``, or that is missing.
        InstallationError: If the installation is incomplete and has no champions to start from.
        CheckpointError: If the file to start from is damaged.
    """
    layout, start = nca_layout(config.task.task), None
    # All weights come back from a checkpoint; other spaces lie around their start.
    is_needed = config.resume is None or config.space != WEIGHTS
    if config.start_from is not None and is_needed:
        start = start_genome(config.start_from, config.task, config.symmetric)
    try:
        space = SPACES[config.space](layout, start)
    except SpaceError as error:
        raise ConfigError(str(error)) from error
    if config.space != WEIGHTS and config.symmetric:
        # At its start a space may treat both sides alike that does not anywhere else.
        beside = space.start + np.linspace(0.5, 1.0, space.dimension)
        for genome in space.genomes(np.stack([space.start, beside])):
            _check_symmetric(layout, genome, f"space={config.space}")
    return space


def start_genome(source: str, task: TaskSettings, symmetric: bool) -> NDArray[np.float64]:
    """Load the genome that a search starts from, float64 ``(num_parameters,)``.

    Args:
        source: Folder of a run, file of a champion or of a genome (of this task), or name of a
            published champion.
        task: The search's task; a champion of another task is ``transferred``.
        symmetric: True for a search among automata that treat left and right alike.

    Raises:
        ConfigError: If there is no such champion, or it is not symmetric as required.
        InstallationError: If the installation is incomplete and has no champions.
        CheckpointError: If its file is damaged.
    """
    layout = nca_layout(task.task)
    own = is_genome_file(source)
    try:
        robot = load_robot(
            source, task=task.name if own else None, grid_size=task.grid_size if own else None
        )
    except (ConfigError, SourceError) as error:
        raise ConfigError(
            f"Cannot start from {source}; if it is an earlier stage, train that stage first. "
            f"{error}"
        ) from error
    start = transferred(robot.genome, nca_layout(robot.task.name), layout)
    if symmetric:
        _check_symmetric(layout, start, f"start_from={source}")
    return start


def _check_symmetric(layout: NCALayout, genome: NDArray[np.float64], setting: str) -> None:
    if not np.allclose(layout.symmetric(genome[None])[0], genome, atol=_TOLERANCE):
        raise ConfigError(
            f"{setting} does not treat left and right alike, but this search requires it; set "
            "symmetric=false."
        )
