"""A genome of one task as the start of a search in another."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import HIDDEN_UNITS, KERNEL_SIZE, NCALayout


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
        genome: Real numbers, ``(num_parameters of source,)``.
        source: Layout of the genome's task.
        target: Layout of the task to search in.

    Raises:
        GenomeError: the genome does not fit ``source``.
    """
    layers = source.layers(source.check_genomes(genome).astype(np.float64))
    reading, bias1, middle, bias2, writing, bias3 = (layer[0] for layer in layers)
    places = {purpose: index for index, purpose in enumerate(source.channel_purposes)}
    new_reading = np.zeros((HIDDEN_UNITS, target.channels, KERNEL_SIZE, KERNEL_SIZE))
    new_writing = np.zeros((target.channels, HIDDEN_UNITS, 1, 1))
    new_bias = np.zeros(target.channels)
    for index, purpose in enumerate(target.channel_purposes):
        if purpose in places:
            new_reading[:, index] = reading[:, places[purpose]]
            new_writing[index] = writing[places[purpose]]
            new_bias[index] = bias3[places[purpose]]
    carried = (new_reading, bias1, middle, bias2, new_writing, new_bias)
    return np.concatenate([layer.ravel() for layer in carried])
