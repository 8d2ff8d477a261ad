"""One robot and its automaton, as kernels: episodes in which bodies change, and live robots."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import BODY_CHANNEL, FIRST_PART_CHANNEL
from ncrs.engines.nca_kernels import (
    CHANGING_CHANNELS,
    CONTROL_LANES,
    GROWTH_LANES,
    UNIT_LANES,
    Buffers,
    FirstLayer,
    FloatArray,
    Graph,
    IntArray,
    Network,
    control_constants,
    grow_on,
    link_cells,
    make_cell_update,
)
from ncrs.engines.rollout_kernels import cell_indices
from ncrs_envs.batched.compiler import kernel
from ncrs_envs.body import Cell

_LONE = 1
"""Number of episodes that a brain drives."""
_EMPTY = int(Cell.EMPTY)
_update_lone_cell = make_cell_update(_LONE, CONTROL_LANES)


class Brain(NamedTuple):
    """The automaton in the cells of one body, in control."""

    network: Network
    constants: FloatArray
    """Constant sums of the first layer, see ``control_constants``."""
    graph: Graph
    indices: IntArray
    """Each place's index among the occupied cells, or -1."""
    states: FloatArray
    """``(occupied cells, 1, CONTROL_LANES)``."""
    updated: FloatArray
    """Buffer of the same shape."""


@kernel
def make_brain(network: Network, part_codes: NDArray[np.int8], body: NDArray[np.int8]) -> Brain:
    """Put the automaton into a body's cells, all hidden and input/output values zero."""
    fixed = FIRST_PART_CHANNEL + part_codes.shape[0]
    graph = link_cells(body, fixed + CHANGING_CHANNELS, fixed)
    cells = graph.start.shape[0] - 1
    return Brain(
        network,
        control_constants(network, part_codes, body),
        graph,
        cell_indices(body),
        np.zeros((cells, _LONE, CONTROL_LANES), dtype=np.float32),
        np.zeros((cells, _LONE, CONTROL_LANES), dtype=np.float32),
    )


@kernel
def inherit_states(before: Brain, after: Brain) -> None:
    """Copy the states of the cells that two bodies on one grid share."""
    for place in range(after.indices.shape[0]):
        source = before.indices[place]
        target = after.indices[place]
        if source >= 0 and target >= 0:
            for lane in range(CONTROL_LANES):
                after.states[target, 0, lane] = before.states[source, 0, lane]


@kernel
def lone_step(brain: Brain, states: FloatArray, updated: FloatArray) -> None:
    """Update every occupied cell once; see ``nca_kernels.control_step``."""
    buffers = Buffers(states, updated, np.empty(2 * UNIT_LANES, dtype=np.float32))
    for cell in range(brain.graph.start.shape[0] - 1):
        layer = FirstLayer(brain.constants, cell * UNIT_LANES, CHANGING_CHANNELS)
        _update_lone_cell(brain.network, brain.graph, layer, buffers, (cell, 0))


@kernel
def standing_lanes(body: NDArray[np.int8], part_codes: NDArray[np.int8]) -> FloatArray:
    """Return the state from which a body grows on: body and part channels, all others zero."""
    states = np.zeros((body.size, 1, GROWTH_LANES), dtype=np.float32)
    n = body.shape[0]
    for row in range(n):
        for column in range(n):
            if body[row, column] == _EMPTY:
                continue
            place = row * n + column
            states[place, 0, BODY_CHANNEL] = 1.0
            for part in range(part_codes.shape[0]):
                if part_codes[part] == body[row, column]:
                    states[place, 0, FIRST_PART_CHANNEL + part] = 1.0
    return states


@kernel
def regrow(
    network: Network,
    part_codes: NDArray[np.int8],
    steps: int,
    body: NDArray[np.int8],
    grown: NDArray[np.int8],
) -> bool:
    """Let a body grow on and return True if all states stayed finite.

    Args:
        network: The genome's weights for growth.
        part_codes: Cell code of each part channel.
        steps: Number of growth steps.
        body: Cell codes of the body that stands, shape ``(n, n)``.
        grown: Output, same shape; the body that stood if a state turned non-finite, or if nothing
            is left.
    """
    grown[:] = body
    if not grow_on(network, part_codes, steps, standing_lanes(body, part_codes), grown):
        return False
    for place in range(grown.size):
        if grown.flat[place] != _EMPTY:
            return True
    grown[:] = body
    return True
