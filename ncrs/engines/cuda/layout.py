"""Where a block's numbers lie in shared memory, and the arguments of the kernels.

Offsets and strides count float32 elements. States lie ``[pair][cell][episode of pair][channel]``;
strides of 17 and 36 in place of 16 and 32 keep the threads of a warp, which read at the same offset
of different cells, from waiting for the same memory bank.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import HIDDEN_UNITS, KERNEL_SIZE
from ncrs.engines.nca_kernels import CHANGING_CHANNELS, CONTROL_LANES, GROWTH_LANES
from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.dtypes import Record
from ncrs_envs.batched.layout import Contact, Robots, Scenarios, Settings, State
from ncrs_envs.cuda.gpu import WARP

POSITIONS = KERNEL_SIZE * KERNEL_SIZE
ROW = 32
"""Stride of a row of weights: the hidden units, padded."""
PAIR = 2
"""Number of episodes that a thread computes together."""
EPISODES = (12, 8, 6, 4, 2)
"""Numbers of episodes that a block may drive, the largest that its shared memory allows."""
STATE = PAIR * CONTROL_LANES + 1
"""Stride of a cell's state in a pair of episodes during control."""
GROWTH_STATE = GROWTH_LANES + 1
"""Stride of a cell's state during growth."""
CONSTANT = 36
"""Stride of a cell's constant sums."""
LAYER = HIDDEN_UNITS * ROW + ROW
"""Length of the second layer's weights and biases."""
CONTROL_THIRD = ROW * CONTROL_LANES + CONTROL_LANES
"""Length of the third layer's weights, with rows for the padded units, and biases."""
GROWTH_THIRD = ROW * GROWTH_LANES + GROWTH_LANES
UNITS = 4
"""Units of the second layer that are computed at once, which bounds the registers in use."""

SCRATCH = 3 * WARP
"""Length of a warp's scratch memory: a flag for every thread (int32), then a float64 for each."""

# During control.
SECOND = POSITIONS * CHANGING_CHANNELS * ROW
THIRD = SECOND + LAYER
WEIGHTS_END = THIRD + CONTROL_THIRD


class HiddenLayers(NamedTuple):
    """Where the second and the third layer of a genome lie, and which of its channels they keep."""

    second: int
    """Offset of the second layer; the third follows it."""
    first_channel: int
    """First channel of the third layer that is kept."""
    lanes: int
    """Stride of the third layer's rows; padded channels, and the control flag, get zeros."""


class Group(NamedTuple):
    """The episodes whose physics one warp computes, each by one of its first threads."""

    genome: int
    """Index of the genome."""
    row: int
    """Its row in the buffers."""
    scenario_row: int
    """Its row in the scenarios."""
    first: int
    """First episode."""
    number: int
    """Number of episodes."""
    scratch: int
    """Offset of the warp's scratch memory."""


class Genomes(NamedTuple):
    """P genomes and the bodies that grow from them."""

    weights: NDArray[np.float32]
    """Genomes, ``(P, num_parameters)``."""
    part_codes: NDArray[np.int8]
    """Cell code of each part channel."""
    bodies: NDArray[np.int8]
    """Cell codes, ``(P, n, n)``."""
    finite: NDArray[np.bool_]
    """False if a state turned non-finite during growth, ``(P,)``."""


class Courses(NamedTuple):
    """Chosen genomes, their robots, and what the robots are driven through."""

    chosen: NDArray[np.int64]
    """Indices of V genomes, whose bodies are valid."""
    robots: Robots
    """Records of the P robots."""
    settings: NDArray[Settings]
    """A single record."""
    scenarios: Scenarios
    """``(P or 1, E)``."""
    steps: int
    """Number of env steps per episode."""
    together: int
    """Maximum number of episodes of one block."""
    driven: int
    """Number of episodes whose physics one warp computes."""


class Move(Record):
    """A robot's move in one step in which it may touch something."""

    start_x: float
    """Pose at the start of the move, or of what is left of it after an impact."""
    start_y: float
    start_angle: float
    first: int
    """First index and end of the quads within reach."""
    end: int
    count: int
    """Number of contact points."""


class Outcome(Record):
    """Result of an episode; see ``ncrs.engines.base.Evaluation``."""

    fitness: float
    success: bool
    crossed: bool
    closest_goal: float
    closest_target: float


class Buffers(NamedTuple):
    """Memory of the episodes of genomes, at least ``(V, E)``."""

    outcomes: NDArray[Outcome]

    states: NDArray[State]
    moves: NDArray[Move]
    contacts: NDArray[Contact]
    """``(V, E, capacity)``."""


class Places(NamedTuple):
    """Offsets in a block's shared memory after the weights, for a body of some number of cells."""

    cell_count: int
    """Number of cells."""
    constants: int
    """Each cell's constant sums."""
    sources: int
    """Index of each cell's neighbour at each position, or -1, int32."""
    indices: int
    """Each place's index among the occupied cells, or -1, int32."""
    cells: int
    """Each occupied cell's place, int32."""
    signals: int
    """Each episode's sensor values, then its gas, by place."""
    signal: int
    """Stride of an episode's sensor values, and of its gas."""
    scratch: int
    """Each warp's scratch memory."""
    states: int
    """Current states."""
    updated: int
    """Updated states."""
    end: int


@kernel
def padded(length: int) -> int:
    """Round up to whole vectors of four."""
    return (length + 3) // 4 * 4


@kernel
def places_of(count: int, grid_places: int, episodes: int, warps: int) -> Places:
    """Return the layout of a block for a robot of ``count`` cells in some episodes."""
    constants = WEIGHTS_END
    sources = constants + count * CONSTANT
    indices = sources + padded(count * POSITIONS)
    cells = indices + padded(grid_places)
    signals = cells + padded(count)
    signal = padded(grid_places)
    scratch = signals + episodes * 2 * signal
    states = scratch + warps * SCRATCH
    length = padded((episodes + PAIR - 1) // PAIR * count * STATE)
    updated = states + length
    end = updated + length
    return Places(
        count, constants, sources, indices, cells, signals, signal, scratch, states, updated, end
    )
