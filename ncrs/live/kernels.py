"""One robot in one episode, step by step, as kernels that the page translates too."""

from __future__ import annotations

import math

import numpy as np

from ncrs.automaton.channels import (
    BODY_CHANNEL,
    CONTROL_CHANNEL,
    FIRST_PART_CHANNEL,
    HIDDEN_UNITS,
    KERNEL_SIZE,
    STEPS_PER_ACTION,
)
from ncrs.engines.brain_kernels import Brain, lone_step
from ncrs.engines.nca_kernels import (
    CHANGING_CHANNELS,
    CONTROL_LANES,
    GROWTH_LANES,
    UNIT_LANES,
    FloatArray,
    Graph,
    Network,
    link_cells,
)
from ncrs.engines.rollout_kernels import read_wheels, write_sensors
from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.layout import State, World
from ncrs_envs.batched.simulate import step_episode


@kernel
def pack_growth(genome: FloatArray, channels: int) -> Network:
    """Lay out a genome's weights for growth; see ``nca_kernels.pack_genomes``."""
    return _pack(genome, channels, 0, GROWTH_LANES)


@kernel
def pack_control(genome: FloatArray, channels: int) -> Network:
    """Lay out a genome's weights for control; see ``nca_kernels.pack_genomes``."""
    return _pack(genome, channels, channels - CHANGING_CHANNELS, CONTROL_LANES)


@kernel
def _pack(genome: FloatArray, channels: int, first_channel: int, lanes: int) -> Network:
    """Lay out weights, with those channels of the third layer that begin at ``first_channel``."""
    positions = KERNEL_SIZE * KERNEL_SIZE
    bias1 = HIDDEN_UNITS * channels * positions
    weight2 = bias1 + HIDDEN_UNITS
    bias2 = weight2 + HIDDEN_UNITS * HIDDEN_UNITS
    weight3 = bias2 + HIDDEN_UNITS
    bias3 = weight3 + channels * HIDDEN_UNITS
    first = np.zeros(positions * channels * UNIT_LANES, dtype=np.float32)
    first_bias = np.zeros(UNIT_LANES, dtype=np.float32)
    second = np.zeros(HIDDEN_UNITS * UNIT_LANES, dtype=np.float32)
    second_bias = np.zeros(UNIT_LANES, dtype=np.float32)
    third = np.zeros(HIDDEN_UNITS * lanes, dtype=np.float32)
    third_bias = np.zeros(lanes, dtype=np.float32)
    for unit in range(HIDDEN_UNITS):
        first_bias[unit] = genome[bias1 + unit]
        second_bias[unit] = genome[bias2 + unit]
        for channel in range(channels):
            for position in range(positions):
                place = (position * channels + channel) * UNIT_LANES + unit
                first[place] = genome[(unit * channels + channel) * positions + position]
        for source in range(HIDDEN_UNITS):
            second[source * UNIT_LANES + unit] = genome[weight2 + unit * HIDDEN_UNITS + source]
        for channel in range(first_channel, channels):
            if channel != CONTROL_CHANNEL:
                weight = genome[weight3 + channel * HIDDEN_UNITS + unit]
                third[unit * lanes + channel - first_channel] = weight
    for channel in range(first_channel, channels):
        if channel != CONTROL_CHANNEL:
            third_bias[channel - first_channel] = genome[bias3 + channel]
    return Network(first, first_bias, second, second_bias, third, third_bias)


@kernel
def link_grid(grid_size: int, channels: int) -> Graph:
    """Link all cells of a grid, for growth."""
    return link_cells(np.ones((grid_size, grid_size), dtype=np.int8), channels, 0)


@kernel
def set_growing_cell(states: FloatArray, place: int, part: int) -> None:
    """Empty a cell of a growing body, or make it a part with nothing else in its state.

    Args:
        states: States of growth, ``(n * n, 1, GROWTH_LANES)``, changed.
        place: Flat grid index.
        part: Index of the part's channel among those of the parts; -1 to empty the cell.
    """
    for lane in range(GROWTH_LANES):
        states[place, 0, lane] = 0.0
    if part >= 0:
        states[place, 0, BODY_CHANNEL] = 1.0
        states[place, 0, FIRST_PART_CHANNEL + part] = 1.0


@kernel
def live_step(
    world: World, state: State, brain: Brain, observations: FloatArray, action: FloatArray
) -> float:
    """Advance automaton and physics by one env step and return the reward.

    It is NaN, and nothing has moved, if a wheel's gas is not finite.

    Args:
        world: The episode's world.
        state: The episode's state, changed.
        brain: The automaton, whose states are changed.
        observations: Sensor values, ``(1, n * n)``, changed.
        action: Output, gas per cell, ``(n * n,)``.
    """
    current = brain.states
    updated = brain.updated
    sensors = world.sensors[: world.robot.sensor_count]
    wheels = world.wheels[: world.robot.wheel_count]
    for _ in range(STEPS_PER_ACTION):
        write_sensors(sensors, brain.indices, observations, current)
        lone_step(brain, current, updated)
        current, updated = updated, current
    brain.states[:] = current
    if not read_wheels(wheels, brain.indices, current, 0, action):
        return math.nan
    return step_episode(world, state, action, observations[0])
