"""The genome that a search starts from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import NCALayout, nca_layout
from ncrs.automaton.transfer import transferred
from ncrs.runs.settings import ConfigError
from ncrs.runs.sources import SourceError, load_robot

_TOLERANCE = 1e-5


def start_genome(source: str, target: NCALayout, symmetric: bool) -> NDArray[np.float64]:
    """The genome that a search starts from, float64 ``(num_parameters,)``.

    Args:
        source: a run's folder, a champion's file, or the name of a published champion.
        target: layout of the task to search in; a champion of another task is ``transferred``.
        symmetric: True for a search among automata that treat left and right alike.

    Raises:
        ConfigError: there is no such champion; or it is not symmetric, and should be.
        CheckpointError: its file is damaged.
    """
    try:
        robot = load_robot(source)
    except (ConfigError, SourceError) as error:
        raise ConfigError(
            f"Cannot start from {source}; if it is an earlier stage, train that first. {error}"
        ) from error
    start = transferred(robot.genome, nca_layout(robot.task.name), target)
    if symmetric and not np.allclose(target.symmetric(start[None])[0], start, atol=_TOLERANCE):
        raise ConfigError(
            f"start_from={source} does not treat left and right alike, and this search is among "
            "automata that do; set symmetric=false."
        )
    return start
