"""The genome that a search starts from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import nca_layout
from ncrs.automaton.transfer import transferred
from ncrs.runs.settings import ConfigError
from ncrs.runs.sources import SourceError, is_genome_file, load_robot
from ncrs_envs.tasks import TaskSettings

_TOLERANCE = 1e-5


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
    if symmetric and not np.allclose(layout.symmetric(start[None])[0], start, atol=_TOLERANCE):
        raise ConfigError(
            f"start_from={source} does not treat left and right alike, but this search requires "
            "it; set symmetric=false."
        )
    return start
