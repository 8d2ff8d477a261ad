"""Control on a GPU: automaton, physics and scoring of all episodes in one launch.

A block drives one robot. Each of its warps drives some pairs of episodes from the first step to the
last without waiting for the others: its threads compute one cell each, in both episodes of a pair,
then one thread for each episode computes the physics. Source: paper section 3.2.
"""

from __future__ import annotations

import math

import numpy as np
from numba import cuda, float32, int32
from numpy.typing import NDArray

from ncrs.automaton.channels import (
    BODY_CHANNEL,
    CONTROL_CHANNEL,
    FIRST_PART_CHANNEL,
    HIDDEN_UNITS,
    KERNEL_SIZE,
    STATE_LIMIT,
    STEPS_PER_ACTION,
)
from ncrs.engines.cuda.contacts import drive_world, move_together
from ncrs.engines.cuda.growth import load_hidden_layers
from ncrs.engines.cuda.layout import (
    CONSTANT,
    PAIR,
    POSITIONS,
    ROW,
    SCRATCH,
    SECOND,
    STATE,
    THIRD,
    UNITS,
    Buffers,
    Courses,
    Genomes,
    Group,
    HiddenLayers,
    Places,
    places_of,
)
from ncrs.engines.cuda.tiles import (
    add_outer_products,
    add_units,
    rectified,
    repeat_row,
    store_clipped_sum,
)
from ncrs.engines.nca_kernels import CHANGING_CHANNELS, CONTROL_LANES, IO_LANE
from ncrs_envs.batched.contacts import move_if_free
from ncrs_envs.batched.layout import World
from ncrs_envs.batched.simulate import observe, push_robot, reset_episode
from ncrs_envs.body import Cell
from ncrs_envs.cuda.gpu import POINT, WARP, device_function, gpu_kernel, reused

_LIMIT = np.float32(STATE_LIMIT)
_EMPTY = int(Cell.EMPTY)
_REACH = KERNEL_SIZE // 2

Floats = NDArray[np.float32]

_push_robot = reused(push_robot)
_move_if_free = reused(move_if_free)
_observe = reused(observe)


@device_function
def _load_weights(genome: Floats, channels: int, shared: Floats) -> None:
    """Lay out a genome for control, by all threads of the block."""
    thread, threads = cuda.threadIdx.x, cuda.blockDim.x
    fixed = channels - CHANGING_CHANNELS
    for item in range(thread, SECOND, threads):
        unit = item % ROW
        channel = fixed + (item // ROW) % CHANGING_CHANNELS
        position = item // (ROW * CHANGING_CHANNELS)
        value = float32(0.0)
        if unit < HIDDEN_UNITS:
            value = genome[(unit * channels + channel) * POSITIONS + position]
        shared[item] = value
    load_hidden_layers(genome, channels, HiddenLayers(SECOND, fixed, CONTROL_LANES), shared)


@device_function
def _number_cells(body: NDArray[np.int8], places: Places) -> None:
    """Write the indices of the occupied cells, row by row, by one thread."""
    marks = cuda.shared.array(0, int32)
    n = body.shape[0]
    found = 0
    for place in range(n * n):
        is_cell = body[place // n, place % n] != _EMPTY
        marks[places.indices + place] = found if is_cell else -1
        if is_cell:
            marks[places.cells + found] = place
            found += 1


@device_function
def _write_constants(
    genome: Floats,
    part_codes: NDArray[np.int8],
    body: NDArray[np.int8],
    shared: Floats,
    places: Places,
) -> None:
    """Write the first layer's sums over bias and fixed channels of each occupied cell."""
    marks = cuda.shared.array(0, int32)
    n = body.shape[0]
    parts = part_codes.shape[0]
    channels = FIRST_PART_CHANNEL + parts + CHANGING_CHANNELS
    bias1 = HIDDEN_UNITS * channels * POSITIONS
    for item in range(cuda.threadIdx.x, places.cell_count * ROW, cuda.blockDim.x):
        cell, unit = item // ROW, item % ROW
        total = float32(0.0)
        if unit < HIDDEN_UNITS:
            place = marks[places.cells + cell]
            row, column = place // n, place % n
            total = genome[bias1 + unit]
            for position in range(POSITIONS):
                i = row + position // KERNEL_SIZE - _REACH
                j = column + position % KERNEL_SIZE - _REACH
                if not (0 <= i < n and 0 <= j < n):
                    continue
                first = unit * channels * POSITIONS + position
                total += genome[first + CONTROL_CHANNEL * POSITIONS]
                if body[i, j] == _EMPTY:
                    continue
                total += genome[first + BODY_CHANNEL * POSITIONS]
                for part in range(parts):
                    if part_codes[part] == body[i, j]:
                        total += genome[first + (FIRST_PART_CHANNEL + part) * POSITIONS]
        shared[places.constants + cell * CONSTANT + unit] = total


@device_function
def _write_neighbors(n: int, places: Places) -> None:
    """Write the index of each occupied cell's neighbour at each position, or -1."""
    marks = cuda.shared.array(0, int32)
    for item in range(cuda.threadIdx.x, places.cell_count * POSITIONS, cuda.blockDim.x):
        cell, position = item // POSITIONS, item % POSITIONS
        place = marks[places.cells + cell]
        i = place // n + position // KERNEL_SIZE - _REACH
        j = place % n + position % KERNEL_SIZE - _REACH
        source = -1
        if 0 <= i < n and 0 <= j < n:
            source = marks[places.indices + i * n + j]
        marks[places.sources + item] = source


@device_function
def _write_sensors(
    world: World, shared: Floats, places: Places, current: int, episodes: int
) -> None:
    """Overwrite the input/output channel of sensor cells with the sensor values."""
    marks = cuda.shared.array(0, int32)
    sensors = world.robot.sensor_count
    for item in range(cuda.threadIdx.x, sensors * episodes, cuda.blockDim.x):
        episode, sensor = item // sensors, item % sensors
        place = world.sensors[sensor].place
        cell = (episode // PAIR) * places.cell_count + marks[places.indices + place]
        state = current + cell * STATE + episode % PAIR * CONTROL_LANES
        shared[state + IO_LANE] = shared[places.signals + episode * 2 * places.signal + place]


@device_function
def _update_cells(shared: Floats, places: Places, pairs: int, current: int, updated: int) -> None:
    """Compute one step of the automaton in the block's pairs of episodes."""
    marks = cuda.shared.array(0, int32)
    for item in range(cuda.threadIdx.x, pairs * places.cell_count, cuda.blockDim.x):
        pair, cell = item // places.cell_count, item % places.cell_count
        first = current + pair * places.cell_count * STATE
        tile = repeat_row(PAIR, HIDDEN_UNITS, shared, places.constants + cell * CONSTANT)
        for position in range(POSITIONS):
            source = marks[places.sources + cell * POSITIONS + position]
            if source >= 0:
                weights = position * CHANGING_CHANNELS * ROW
                inputs = first + source * STATE
                tile = add_outer_products(
                    tile, CHANGING_CHANNELS, ROW, shared, weights, inputs, CONTROL_LANES
                )
        hidden = rectified(tile)
        change = repeat_row(PAIR, CHANGING_CHANNELS, shared, THIRD + ROW * CONTROL_LANES)
        for unit in range(0, ROW, UNITS):
            change = add_units(
                change,
                hidden,
                UNITS,
                ROW,
                CONTROL_LANES,
                shared,
                SECOND + unit,
                SECOND + HIDDEN_UNITS * ROW + unit,
                THIRD + unit * CONTROL_LANES,
            )
        store_clipped_sum(
            change, _LIMIT, shared, current + item * STATE, updated + item * STATE, CONTROL_LANES
        )


@device_function
def _read_wheels(world: World, shared: Floats, indices: int, states: int, action: Floats) -> bool:
    """Read the wheels' gas of one episode and return True if all of it is finite."""
    marks = cuda.shared.array(0, int32)
    finite = True
    for i in range(world.robot.wheel_count):
        place = world.wheels[i].place
        gas = shared[states + marks[indices + place] * STATE + IO_LANE]
        action[place] = gas
        finite = finite and math.isfinite(gas)
    return finite


@device_function
def _are_finite(shared: Floats, count: int, states: int) -> bool:
    """Return True if the states of all cells are finite in one episode."""
    for cell in range(count):
        for channel in range(CHANGING_CHANNELS):
            if not math.isfinite(shared[states + cell * STATE + channel]):
                return False
    return True


@gpu_kernel
def roll_out(genomes: Genomes, courses: Courses, buffers: Buffers) -> None:
    """Drive one robot for each block of the grid's first axis through its episodes.

    The blocks of the second axis share the robot's episodes.
    """
    shared = cuda.shared.array(0, float32)
    corners = cuda.local.array(4, POINT)
    thread, threads = cuda.threadIdx.x, cuda.blockDim.x
    lane, warp = thread % WARP, thread // WARP
    row = cuda.blockIdx.x
    index = courses.chosen[row]
    genome = genomes.weights[index]
    body = genomes.bodies[index]
    n = body.shape[0]
    first_of_block = cuda.blockIdx.y * courses.together
    episodes = min(courses.together, buffers.outcomes.shape[1] - first_of_block)
    pairs = (episodes + PAIR - 1) // PAIR
    count = 0
    for place in range(n * n):
        if body[place // n, place % n] != _EMPTY:
            count += 1
    places = places_of(count, n * n, episodes, threads // WARP)
    if thread == 0:
        _number_cells(body, places)
    for place in range(places.signals + thread, places.end, threads):
        shared[place] = float32(0.0)
    channels = FIRST_PART_CHANNEL + genomes.part_codes.shape[0] + CHANGING_CHANNELS
    _load_weights(genome, channels, shared)
    cuda.syncthreads()
    _write_constants(genome, genomes.part_codes, body, shared, places)
    _write_neighbors(n, places)
    cuda.syncthreads()

    # Each of the first warps computes the physics of some episodes, each by one of its threads.
    first_of_warp = warp * courses.driven
    number = max(0, min(courses.driven, episodes - first_of_warp))
    drives = lane < number
    own = min(first_of_warp + lane, episodes - 1)
    episode = first_of_block + own
    slot = places.signals + own * 2 * places.signal
    observation = shared[slot : slot + n * n]
    action = shared[slot + places.signal : slot + places.signal + n * n]
    scenario_row = index % courses.scenarios.scenarios.shape[0]
    state = buffers.states[row, episode]
    scratch = places.scratch + warp * SCRATCH
    group = Group(index, row, scenario_row, first_of_block + first_of_warp, number, scratch)
    world = drive_world(courses, group, episode, buffers.contacts[row, episode], corners)
    own_states = own // PAIR * places.cell_count * STATE + own % PAIR * CONTROL_LANES
    current, updated = places.states, places.updated
    total = 0.0
    if drives:
        reset_episode(world, state, observation)
    cuda.syncthreads()
    for _ in range(courses.steps):
        for _ in range(STEPS_PER_ACTION):
            _write_sensors(world, shared, places, current, episodes)
            cuda.syncthreads()
            _update_cells(shared, places, pairs, current, updated)
            current, updated = updated, current
            cuda.syncthreads()
        if number > 0:
            runs = touches = False
            if drives:
                if not _read_wheels(world, shared, places.indices, current + own_states, action):
                    total = math.nan
                runs = math.isfinite(total)
                if runs:
                    _push_robot(world, state, action)
                    touches = not _move_if_free(world, state)
            move_together(courses, buffers, group, world, state, touches)
            if runs:
                total += _observe(world, state, observation)
        cuda.syncthreads()
    if drives:
        outcome = buffers.outcomes[row, episode]
        finite = _are_finite(shared, places.cell_count, current + own_states)
        outcome.fitness = total / courses.steps if finite else math.nan
        outcome.success = state.success
        outcome.crossed = state.crossed
        outcome.closest_goal = state.closest_goal
        outcome.closest_target = state.closest_target
