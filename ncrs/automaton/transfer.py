"""Transfer of a genome of one task to another, as the start of a search."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import HIDDEN_UNITS, KERNEL_SIZE, NCALayout


def transferred(genome: Any, source: NCALayout, target: NCALayout) -> NDArray[np.float64]:
    """Convert a genome to the channels of another task.

    Channels are matched by purpose, those of parts by cell type. The weights of channels that both
    tasks have are kept; channels that only the target has are neither read nor written, and the
    weights of channels that only the source has are dropped.

    Between tasks with the same channels the result is a copy. Towards CarryBall, the new automaton
    grows a body of the same shape, in which only cells with negative values for all parts of the
    source become target sensors; with the same body and sensor values it acts the same. From
    CarryBall, the automaton loses the channel of the target sensor, which it may have relied on, so
    body and behaviour may differ.

    Args:
        genome: Real numbers, shape ``(source.num_parameters,)``.
        source: Layout of the genome's task.
        target: Layout of the task to search in.

    Returns:
        The new genome, float64 ``(target.num_parameters,)``.

    Raises:
        GenomeError: The genome does not fit ``source``.
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
