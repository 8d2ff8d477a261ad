"""Growth on a GPU: one warp grows one body. Source: paper section 3.1."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
from numba import cuda, float32, int32
from numpy.typing import NDArray

from ncrs.automaton.channels import (
    ALIVE_THRESHOLD,
    BODY_CHANNEL,
    CONTROL_CHANNEL,
    FIRST_PART_CHANNEL,
    HIDDEN_UNITS,
    KERNEL_SIZE,
    STATE_LIMIT,
)
from ncrs.engines.cuda.layout import (
    GROWTH_STATE,
    GROWTH_THIRD,
    LAYER,
    POSITIONS,
    ROW,
    UNITS,
    Courses,
    Genomes,
    HiddenLayers,
)
from ncrs.engines.cuda.tiles import (
    add_outer_products,
    add_units,
    rectified,
    repeat_row,
    store_clipped_sum,
    sync_warp,
)
from ncrs.engines.nca_kernels import GROWTH_LANES
from ncrs_envs.batched.robot import prepare_robot
from ncrs_envs.body import Cell
from ncrs_envs.cuda.gpu import WARP, device_function, gpu_kernel

_LIMIT = np.float32(STATE_LIMIT)
_EMPTY = int(Cell.EMPTY)
_REACH = KERNEL_SIZE // 2


@device_function
def load_hidden_layers(
    genome: NDArray[np.float32], channels: int, layers: HiddenLayers, shared: NDArray[np.float32]
) -> None:
    """Lay out the second and the third layer of a genome in shared memory, by all threads.

    Args:
        genome: Flat weights of one genome.
        channels: Number of channels C.
        layers: Where the layers lie.
        shared: The block's shared memory.
    """
    thread, threads = cuda.threadIdx.x, cuda.blockDim.x
    bias1 = HIDDEN_UNITS * channels * POSITIONS
    weight2 = bias1 + HIDDEN_UNITS
    bias2 = weight2 + HIDDEN_UNITS * HIDDEN_UNITS
    weight3 = bias2 + HIDDEN_UNITS
    bias3 = weight3 + channels * HIDDEN_UNITS
    for item in range(thread, LAYER, threads):
        row, unit = item // ROW, item % ROW
        value = float32(0.0)
        if unit < HIDDEN_UNITS:
            if row < HIDDEN_UNITS:
                value = genome[weight2 + unit * HIDDEN_UNITS + row]
            else:
                value = genome[bias2 + unit]
        shared[layers.second + item] = value
    for item in range(thread, (ROW + 1) * layers.lanes, threads):
        row, lane = item // layers.lanes, item % layers.lanes
        channel = layers.first_channel + lane
        value = float32(0.0)
        if channel < channels and channel != CONTROL_CHANNEL:
            if row < HIDDEN_UNITS:
                value = genome[weight3 + channel * HIDDEN_UNITS + row]
            elif row == ROW:
                value = genome[bias3 + channel]
        shared[layers.second + LAYER + item] = value


def growth_shared(channels: int, places: int) -> int:
    """Return the float32 elements of shared memory that a body's growth takes."""
    return _states_of(channels) + 2 * places * GROWTH_STATE


def _states_of(channels: int) -> int:
    return POSITIONS * channels * ROW + ROW + LAYER + GROWTH_THIRD


@cache
def make_growth_kernel(channels: int) -> Any:
    """Make the kernel that grows bodies, for a task's number of channels."""
    first_bias = POSITIONS * channels * ROW
    second = first_bias + ROW
    third = second + LAYER
    states = _states_of(channels)

    @gpu_kernel
    def grow_population(genomes: Genomes, steps: int) -> None:
        """Grow the body of one genome for each block, which is a single warp."""
        shared = cuda.shared.array(0, float32)
        index = cuda.blockIdx.x
        lane = cuda.threadIdx.x
        genome = genomes.weights[index]
        body = genomes.bodies[index]
        n = body.shape[0]
        places = n * n
        for item in range(lane, POSITIONS * channels * ROW, WARP):
            unit = item % ROW
            channel = (item // ROW) % channels
            position = item // (ROW * channels)
            value = float32(0.0)
            if unit < HIDDEN_UNITS:
                value = genome[(unit * channels + channel) * POSITIONS + position]
            shared[item] = value
        bias1 = HIDDEN_UNITS * channels * POSITIONS
        for unit in range(lane, ROW, WARP):
            shared[first_bias + unit] = (
                genome[bias1 + unit] if unit < HIDDEN_UNITS else float32(0.0)
            )
        load_hidden_layers(genome, channels, HiddenLayers(second, 0, GROWTH_LANES), shared)
        for item in range(lane, 2 * places * GROWTH_STATE, WARP):
            shared[states + item] = float32(0.0)
        sync_warp()
        middle = n // 2
        if lane == 0:
            shared[states + (middle * n + middle) * GROWTH_STATE + BODY_CHANNEL] = float32(1.0)
        current = states
        updated = states + places * GROWTH_STATE
        finite = True
        sync_warp()
        for _ in range(steps):
            for place in range(lane, places, WARP):
                row, column = place // n, place % n
                alive = False
                for position in range(POSITIONS):
                    i = row + position // KERNEL_SIZE - _REACH
                    j = column + position % KERNEL_SIZE - _REACH
                    if 0 <= i < n and 0 <= j < n:
                        value = shared[current + (i * n + j) * GROWTH_STATE + BODY_CHANNEL]
                        alive = alive or value > ALIVE_THRESHOLD
                target = updated + place * GROWTH_STATE
                if alive:
                    tile = repeat_row(1, HIDDEN_UNITS, shared, first_bias)
                    for position in range(POSITIONS):
                        i = row + position // KERNEL_SIZE - _REACH
                        j = column + position % KERNEL_SIZE - _REACH
                        if 0 <= i < n and 0 <= j < n:
                            source = current + (i * n + j) * GROWTH_STATE
                            weights = position * channels * ROW
                            tile = add_outer_products(
                                tile, channels, ROW, shared, weights, source, GROWTH_LANES
                            )
                    hidden = rectified(tile)
                    change = repeat_row(1, GROWTH_LANES, shared, third + ROW * GROWTH_LANES)
                    for unit in range(0, ROW, UNITS):
                        change = add_units(
                            change,
                            hidden,
                            UNITS,
                            ROW,
                            GROWTH_LANES,
                            shared,
                            second + unit,
                            second + HIDDEN_UNITS * ROW + unit,
                            third + unit * GROWTH_LANES,
                        )
                    source = current + place * GROWTH_STATE
                    store_clipped_sum(change, _LIMIT, shared, source, target, GROWTH_LANES)
                else:
                    for channel in range(GROWTH_LANES):
                        shared[target + channel] = float32(0.0)
                for channel in range(GROWTH_LANES):
                    finite = finite and math.isfinite(shared[target + channel])
            current, updated = updated, current
            sync_warp()
        for place in range(lane, places, WARP):
            code = _EMPTY
            first = current + place * GROWTH_STATE
            if shared[first + BODY_CHANNEL] > ALIVE_THRESHOLD:
                best = 0
                for part in range(1, genomes.part_codes.shape[0]):
                    value = shared[first + FIRST_PART_CHANNEL + part]
                    if value > shared[first + FIRST_PART_CHANNEL + best]:
                        best = part
                code = genomes.part_codes[best]
            body[place // n, place % n] = code
        # A block's flag for all its threads; the states are not read any more.
        sync_warp()
        flags = cuda.shared.array(0, int32)
        if lane == 0:
            flags[0] = 1
        sync_warp()
        if not finite:
            flags[0] = 0
        sync_warp()
        if flags[0] == 0:
            for place in range(lane, places, WARP):
                body[place // n, place % n] = _EMPTY
        if lane == 0:
            genomes.finite[index] = flags[0] != 0

    return grow_population


@gpu_kernel
def prepare_robots(genomes: Genomes, courses: Courses) -> None:
    """Fill the records of the chosen robots, one per thread."""
    i = cuda.grid(1)
    if i < courses.chosen.shape[0]:
        index = courses.chosen[i]
        robots = courses.robots
        prepare_robot(
            genomes.bodies[index],
            robots.robots[index],
            robots.wheels[index],
            robots.sensors[index],
            robots.exposed[index],
        )
