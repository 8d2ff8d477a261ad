"""NCA as numba kernels: growth and control of one genome, in all its episodes at once.

The second and third layers are matrix products; the first is one matrix product per neighbour,
taken over the neighbours that exist. Three savings are exact: during control the fixed channels
contribute a constant per cell to the first layer; only the channels that change are computed; and
cells that are empty or outside the grid contribute nothing, so they are not visited.

Arrays are float32, weights flat. States have shape ``(cells, episodes, lanes)``, with the channels
padded to ``GROWTH_LANES`` or ``CONTROL_LANES``; hidden units lie ``[episode][unit]``, padded to
``UNIT_LANES``. Every value is computed in one fixed order, so results depend neither on the thread
nor on the index of an episode or a genome. Source: paper section 3.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import (
    ALIVE_THRESHOLD,
    BODY_CHANNEL,
    CONTROL_CHANNEL,
    FIRST_PART_CHANNEL,
    HIDDEN_CHANNELS,
    HIDDEN_UNITS,
    KERNEL_SIZE,
    STATE_LIMIT,
    NCALayout,
)
from ncrs.engines.tiles import (
    add_outer_product,
    repeat_row,
    store_clipped_sum,
    store_rectified,
)
from ncrs_envs.batched.compiler import kernel
from ncrs_envs.body import Cell

UNIT_LANES = 32
"""Hidden units of the first or second layer, padded to whole vectors."""
GROWTH_LANES = 16
"""All channels, padded to whole vectors."""
CONTROL_LANES = 8
"""Channels that change during control, padded to whole vectors."""
EPISODE_TILE = 6
"""Number of episodes that are computed together: half of the paper's 12. Their accumulators fill 12
of 32 vector registers of 512 bits; more is slower where registers are fewer and narrower."""

CHANGING_CHANNELS = HIDDEN_CHANNELS + 1
IO_LANE = CHANGING_CHANNELS - 1
"""Lane of the input/output channel in a control state."""
_REACH = KERNEL_SIZE // 2
_EMPTY = int(Cell.EMPTY)
_LIMIT = np.float32(STATE_LIMIT)

FloatArray = NDArray[np.float32]
IntArray = NDArray[np.int64]
_Place = tuple[int, int]
"""A cell's index, and an episode's."""


class Network(NamedTuple):
    """Weights laid out for tiles, as flat arrays.

    For a population, the genomes are the leading axis.
    """

    first: FloatArray
    """``[kernel position][channel][unit]``, positions row by row."""
    first_bias: FloatArray
    second: FloatArray
    """``[unit in][unit out]``."""
    second_bias: FloatArray
    third: FloatArray
    """``[unit][channel]``, with padded channels."""
    third_bias: FloatArray


class Graph(NamedTuple):
    """Cells and, for each, the existing cells in its 3 x 3 neighbourhood, itself included."""

    start: IntArray
    """Links of cell ``i`` are ``start[i]`` to ``start[i + 1]``."""
    source: IntArray
    """Index of the neighbour that a link reads."""
    weights: IntArray
    """Offset in ``Network.first`` of the link's first weight."""


def pack_genomes(genomes: FloatArray, layout: NCALayout) -> tuple[Network, Network]:
    """Lay out the weights of P genomes for growth and for control.

    Args:
        genomes: Checked genomes, float32 ``(P, num_parameters)``.
        layout: The NCA's channels.

    Returns:
        The network of all channels, and the one whose third layer has only the changing channels;
        arrays have shape ``(P, ...)``. The control flag's update is zero.
    """
    population = len(genomes)
    weight1, bias1, weight2, bias2, weight3, bias3 = layout.layers(genomes)
    positions = KERNEL_SIZE * KERNEL_SIZE
    weight1 = weight1.reshape(population, HIDDEN_UNITS, layout.channels, positions)
    shared = (
        _padded(weight1.transpose(0, 3, 2, 1), UNIT_LANES),
        _padded(bias1, UNIT_LANES),
        _padded(weight2[..., 0, 0].transpose(0, 2, 1), UNIT_LANES),
        _padded(bias2, UNIT_LANES),
    )
    third = np.array(weight3[..., 0, 0].transpose(0, 2, 1))
    third_bias = bias3.copy()
    third[..., CONTROL_CHANNEL] = 0.0
    third_bias[..., CONTROL_CHANNEL] = 0.0
    changing = layout.changing_channels
    growth = Network(*shared, _padded(third, GROWTH_LANES), _padded(third_bias, GROWTH_LANES))
    control = Network(
        *shared,
        _padded(third[..., changing], CONTROL_LANES),
        _padded(third_bias[..., changing], CONTROL_LANES),
    )
    return growth, control


def _padded(weights: FloatArray, lanes: int) -> FloatArray:
    """Pad the last axis with zeros and flatten all but the first."""
    padded = np.zeros((*weights.shape[:-1], lanes), dtype=np.float32)
    padded[..., : weights.shape[-1]] = weights
    return padded.reshape(len(weights), -1)


@kernel
def network_of(networks: Network, genome: int) -> Network:
    """Return one genome's network out of a population's."""
    return Network(
        networks.first[genome],
        networks.first_bias[genome],
        networks.second[genome],
        networks.second_bias[genome],
        networks.third[genome],
        networks.third_bias[genome],
    )


@kernel
def link_cells(exists: NDArray[np.int8], channels: int, first_channel: int) -> Graph:
    """Link every existing cell to its neighbours; indices run over existing cells, row by row.

    Args:
        exists: Grid, shape ``(n, n)``, nonzero where there is a cell.
        channels: Number of channels of the first layer.
        first_channel: Index of the first channel that links read.
    """
    n = exists.shape[0]
    indices = np.empty((n, n), dtype=np.int64)
    cells = 0
    for row in range(n):
        for column in range(n):
            indices[row, column] = cells
            if exists[row, column] != 0:
                cells += 1
    start = np.zeros(cells + 1, dtype=np.int64)
    source = np.empty(cells * KERNEL_SIZE**2, dtype=np.int64)
    weights = np.empty(cells * KERNEL_SIZE**2, dtype=np.int64)
    links = 0
    for row in range(n):
        for column in range(n):
            if exists[row, column] == 0:
                continue
            for i in range(max(row - _REACH, 0), min(row + _REACH + 1, n)):
                for j in range(max(column - _REACH, 0), min(column + _REACH + 1, n)):
                    if exists[i, j] != 0:
                        position = (i - row + _REACH) * KERNEL_SIZE + j - column + _REACH
                        source[links] = indices[i, j]
                        weights[links] = (position * channels + first_channel) * UNIT_LANES
                        links += 1
            start[indices[row, column] + 1] = links
    return Graph(start, source, weights)


class FirstLayer(NamedTuple):
    """Initial sums of the first layer, from ``start`` on, and number of channels that links add."""

    constants: FloatArray
    start: int
    channels: int


class Buffers(NamedTuple):
    """Current states, updated ones, and a buffer for two layers of hidden units."""

    states: FloatArray
    updated: FloatArray
    units: FloatArray


def make_cell_update(rows: int, lanes: int) -> Callable[..., None]:
    """Make the kernel that updates a cell in ``rows`` episodes, with tiles of constant size."""

    @kernel
    def update_cell(
        network: Network, graph: Graph, layer: FirstLayer, buffers: Buffers, place: _Place
    ) -> None:
        """Write ``clip(x + dx)`` of a cell in ``rows`` episodes, from that of ``place`` on."""
        states, updated, units = buffers
        cell, episode = place
        episodes = states.shape[1]
        tile = repeat_row(rows, UNIT_LANES, layer.constants, layer.start)
        for link in range(graph.start[cell], graph.start[cell + 1]):
            source = (graph.source[link] * episodes + episode) * lanes
            weights = graph.weights[link]
            for channel in range(layer.channels):
                weight = weights + channel * UNIT_LANES
                tile = add_outer_product(
                    tile, network.first, weight, states, source + channel, lanes
                )
        store_rectified(tile, units, 0, UNIT_LANES)
        second = rows * UNIT_LANES
        tile = repeat_row(rows, UNIT_LANES, network.second_bias, 0)
        for unit in range(HIDDEN_UNITS):
            weight = unit * UNIT_LANES
            tile = add_outer_product(tile, network.second, weight, units, unit, UNIT_LANES)
        store_rectified(tile, units, second, UNIT_LANES)
        change = repeat_row(rows, lanes, network.third_bias, 0)
        for unit in range(HIDDEN_UNITS):
            change = add_outer_product(
                change, network.third, unit * lanes, units, second + unit, UNIT_LANES
            )
        first = (cell * episodes + episode) * lanes
        store_clipped_sum(change, _LIMIT, states, updated, first, lanes)

    return update_cell


_update_growing_cell = make_cell_update(1, GROWTH_LANES)
_update_control_cells = make_cell_update(EPISODE_TILE, CONTROL_LANES)


@kernel
def growth_step(
    network: Network, graph: Graph, channels: int, states: FloatArray, updated: FloatArray
) -> bool:
    """Compute one step of growth and return True if every new value is finite.

    A cell lives if any body value of its neighbourhood exceeds 0.1 before the update; the others
    become zero.

    Args:
        network: The genome's weights for growth.
        graph: Links of the whole grid.
        channels: Number of channels C.
        states: Current states, ``(cells, 1, GROWTH_LANES)``.
        updated: Output, same shape.
    """
    buffers = Buffers(states, updated, np.empty(2 * UNIT_LANES, dtype=np.float32))
    layer = FirstLayer(network.first_bias, 0, channels)
    finite = True
    for cell in range(graph.start.shape[0] - 1):
        alive = False
        for link in range(graph.start[cell], graph.start[cell + 1]):
            body = states[graph.source[link], 0, BODY_CHANNEL]
            alive = alive or body > ALIVE_THRESHOLD
        if alive:
            _update_growing_cell(network, graph, layer, buffers, (cell, 0))
        else:
            updated[cell] = 0.0
        for lane in range(GROWTH_LANES):
            finite = finite and np.isfinite(updated[cell, 0, lane])
    return finite


@kernel
def seed_lanes(grid_size: int) -> FloatArray:
    """Return the state that growth starts from: body 1 in the middle cell."""
    states = np.zeros((grid_size * grid_size, 1, GROWTH_LANES), dtype=np.float32)
    middle = grid_size // 2
    states[middle * grid_size + middle, 0, BODY_CHANNEL] = 1.0
    return states


@kernel
def grow_body(
    network: Network, part_codes: NDArray[np.int8], steps: int, body: NDArray[np.int8]
) -> bool:
    """Grow a body from the seed and return True if all states stayed finite.

    A cell is occupied if its body value exceeds 0.1; its part is that of the part channel with
    the maximum value, the first on a tie.

    Args:
        network: The genome's weights for growth.
        part_codes: Cell code of each part channel.
        steps: Number of growth steps.
        body: Output, cell codes, shape ``(n, n)``; empty if a state turned non-finite.
    """
    body[:] = _EMPTY
    return grow_on(network, part_codes, steps, seed_lanes(body.shape[0]), body)


@kernel
def grow_on(
    network: Network,
    part_codes: NDArray[np.int8],
    steps: int,
    states: FloatArray,
    body: NDArray[np.int8],
) -> bool:
    """Grow a body from states as ``grow_body`` does; leave it as it was if one is not finite."""
    channels = FIRST_PART_CHANNEL + part_codes.shape[0] + CHANGING_CHANNELS
    graph = link_cells(np.ones((body.shape[0], body.shape[0]), dtype=np.int8), channels, 0)
    updated = np.empty_like(states)
    for _ in range(steps):
        if not growth_step(network, graph, channels, states, updated):
            return False
        states, updated = updated, states
    read_grown(states, part_codes, body)
    return True


@kernel
def read_grown(states: FloatArray, part_codes: NDArray[np.int8], body: NDArray[np.int8]) -> None:
    """Read a body out of states of growth, ``(n * n, 1, GROWTH_LANES)``; the rest as above."""
    n = body.shape[0]
    for row in range(n):
        for column in range(n):
            cell = states[row * n + column, 0]
            body[row, column] = _EMPTY
            if cell[BODY_CHANNEL] > ALIVE_THRESHOLD:
                values = cell[FIRST_PART_CHANNEL:][: part_codes.shape[0]]
                body[row, column] = part_codes[np.argmax(values)]


@kernel
def control_constants(
    network: Network, part_codes: NDArray[np.int8], body: NDArray[np.int8]
) -> FloatArray:
    """Return the first layer's constant sums over bias and fixed channels.

    They lie ``[occupied cell][unit]``. The control flag is 1 in every cell of the grid, the body
    and part channels only in occupied ones.
    """
    n = body.shape[0]
    channels = FIRST_PART_CHANNEL + part_codes.shape[0] + CHANGING_CHANNELS
    constants = np.empty(n * n * UNIT_LANES, dtype=np.float32)
    cell = 0
    for row in range(n):
        for column in range(n):
            if body[row, column] == _EMPTY:
                continue
            total = constants[cell * UNIT_LANES : (cell + 1) * UNIT_LANES]
            total[:] = network.first_bias
            cell += 1
            for i in range(max(row - _REACH, 0), min(row + _REACH + 1, n)):
                for j in range(max(column - _REACH, 0), min(column + _REACH + 1, n)):
                    position = (i - row + _REACH) * KERNEL_SIZE + j - column + _REACH
                    first = position * channels
                    _add_weights(network.first, first + CONTROL_CHANNEL, total)
                    if body[i, j] == _EMPTY:
                        continue
                    _add_weights(network.first, first + BODY_CHANNEL, total)
                    for part in range(part_codes.shape[0]):
                        if part_codes[part] == body[i, j]:
                            _add_weights(network.first, first + FIRST_PART_CHANNEL + part, total)
    return constants[: cell * UNIT_LANES]


@kernel
def _add_weights(first: FloatArray, row: int, total: FloatArray) -> None:
    for unit in range(UNIT_LANES):
        total[unit] += first[row * UNIT_LANES + unit]


@kernel
def control_step(
    network: Network,
    constants: FloatArray,
    graph: Graph,
    states: FloatArray,
    updated: FloatArray,
) -> None:
    """Update every occupied cell in every episode once.

    Args:
        network: The genome's weights for control.
        constants: Constant sums from ``control_constants``.
        graph: Links of the occupied cells, from the first changing channel on.
        states: Current states, ``(occupied cells, episodes, CONTROL_LANES)``; the number of
            episodes is a multiple of ``EPISODE_TILE``.
        updated: Output, same shape.
    """
    units = np.empty(2 * EPISODE_TILE * UNIT_LANES, dtype=np.float32)
    buffers = Buffers(states, updated, units)
    for cell in range(graph.start.shape[0] - 1):
        layer = FirstLayer(constants, cell * UNIT_LANES, CHANGING_CHANNELS)
        for episode in range(0, states.shape[1], EPISODE_TILE):
            _update_control_cells(network, graph, layer, buffers, (cell, episode))
