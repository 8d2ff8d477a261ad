"""A genome of one task as the start of a search in another."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import FEATURES, HIDDEN_CHANNELS, KERNEL_SIZE, NCALayout, nca_layout
from ncrs.runs.published import load_any_champion
from ncrs.runs.settings import ConfigError

_TOLERANCE = 1e-5


def start_genome(source: str, target: NCALayout, symmetric: bool) -> NDArray[np.float64]:
    """The genome that a search starts from, float64 ``(num_parameters,)``.

    Args:
        source: a run's folder, a champion's file, or the name of a published champion.
        target: of the task to search in; a champion of another task is ``transferred``.
        symmetric: whether the search is among automata that treat left and right alike.

    Raises:
        ConfigError: there is no such champion; or it is not symmetric, and should be.
        CheckpointError: its file is damaged.
    """
    try:
        champion = load_any_champion(source)
    except ConfigError as error:
        raise ConfigError(
            f"Cannot start from {source}; if it is an earlier stage, train that first. {error}"
        ) from error
    start = transferred(champion.genome, nca_layout(champion.task.name), target)
    if symmetric and not np.allclose(target.symmetric(start[None])[0], start, atol=_TOLERANCE):
        raise ConfigError(
            f"start_from={source} does not treat left and right alike, and this search is among "
            "automata that do; set symmetric=false."
        )
    return start


def transferred(genome: Any, source: NCALayout, target: NCALayout) -> NDArray[np.float64]:
    """The genome for another task's channels, float64 ``(num_parameters of target,)``.

    Channels are matched by what they are for, a part's by its cell type. What the automaton reads
    and writes in channels that both tasks have stays as it is; channels that only the target has
    are neither read nor written, and those that only the source has are lost.

    Between tasks with the same channels it is a copy. Towards CarryBall, it grows a body of the
    same shape, in which only cells with negative values for all the parts that the source has
    become target sensors, and with the same body and sensor values it does the same. From
    CarryBall, the automaton loses the target sensor's channel, in which it may have kept what it
    needs: body and behaviour may be others.

    Args:
        genome: real numbers, ``(num_parameters of source,)``.
        source: of the genome.
        target: of the task to search in.

    Raises:
        GenomeError: the genome does not fit ``source``.
    """
    layers = source.layers(source.check_genomes(genome).astype(np.float64))
    reading, bias1, middle, bias2, writing, bias3 = (layer[0] for layer in layers)
    names = {name: index for index, name in enumerate(_channel_names(source))}
    new_reading = np.zeros((FEATURES, target.channels, KERNEL_SIZE, KERNEL_SIZE))
    new_writing = np.zeros((target.channels, FEATURES, 1, 1))
    new_bias = np.zeros(target.channels)
    for index, name in enumerate(_channel_names(target)):
        if name in names:
            new_reading[:, index] = reading[:, names[name]]
            new_writing[index] = writing[names[name]]
            new_bias[index] = bias3[names[name]]
    carried = (new_reading, bias1, middle, bias2, new_writing, new_bias)
    return np.concatenate([layer.ravel() for layer in carried])


def _channel_names(layout: NCALayout) -> list[str]:
    parts = [cell.name for cell in layout.task.part_cells]
    return ["body", "control", *parts, *map(str, range(HIDDEN_CHANNELS)), "input/output"]
