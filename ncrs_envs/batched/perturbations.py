"""Perturbations as records, and kernels that carry them out; see ``ncrs_envs.perturbations``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.dtypes import Record, records
from ncrs_envs.batched.layout import Robot, Sensor, State, World
from ncrs_envs.batched.noise import normal_value
from ncrs_envs.batched.sensing import sense
from ncrs_envs.body import Cell
from ncrs_envs.noise import SENSOR_NOISE
from ncrs_envs.perturbations import ROUNDING, CellChoice
from ncrs_envs.scenario import Scenario

NEVER = -1
"""Step of what does not happen, and the index after the last of fewer cells than the grid has."""
_ALL = -1.0
"""Fraction that stands for all cells of a choice."""
_EMPTY = int(Cell.EMPTY)
_WHEEL = int(Cell.WHEEL)


class Perturbation(Record):
    """Perturbations of one episode."""

    damage_step: int
    damage_fraction: float
    failure_step: int
    failure_fraction: float
    seed: int
    """Seed of the noise."""
    sensor_noise: float
    state_noise: float
    repair_steps: int
    """Number of growth steps; 0 for no repair."""
    repair_every: int
    """Number of actions between two repairs; 0 for one after the damage."""


class Perturbations(NamedTuple):
    """Perturbations of many episodes, with the same first axes in all arrays."""

    perturbations: NDArray[Perturbation]
    damaged: NDArray[np.int64]
    """Flat indices of the cells that may vanish, in order, ``(..., n * n)``; then ``NEVER``."""
    failing: NDArray[np.int64]
    """The same for wheels that may fail."""


def perturbation_records(scenarios: Sequence[Scenario], grid_size: int) -> Perturbations:
    """Return the records of many scenarios."""
    count, places = len(scenarios), grid_size * grid_size
    orders = np.full((2, count, places), NEVER, dtype=np.int64)
    made = Perturbations(records(Perturbation, count), orders[0], orders[1])
    for i, scenario in enumerate(scenarios):
        record: Perturbation = made.perturbations[i]
        damage, failure = scenario.damage, scenario.failure
        record.damage_step, record.damage_fraction = _choice(damage, made.damaged[i], grid_size)
        record.failure_step, record.failure_fraction = _choice(failure, made.failing[i], grid_size)
        if scenario.noise is not None:
            record.seed = scenario.noise.seed
            record.sensor_noise = scenario.noise.sensor
            record.state_noise = scenario.noise.state
        if scenario.repair is not None:
            record.repair_steps = scenario.repair.steps
            record.repair_every = scenario.repair.every
    return made


def _choice(
    choice: CellChoice | None, order: NDArray[np.int64], grid_size: int
) -> tuple[int, float]:
    """Write the cells of a choice in order, and return its step and fraction."""
    if choice is None:
        return NEVER, _ALL
    cells = [row * grid_size + column for row, column in choice.cells]
    order[: len(cells)] = cells
    return choice.step, _ALL if choice.fraction is None else choice.fraction


@kernel
def lose_cells(
    body: NDArray[np.int8], order: NDArray[np.int64], fraction: float, left: NDArray[np.int8]
) -> None:
    """Write what damage leaves of a body; see ``perturbations.Damage.left``.

    Args:
        body: Cell codes, shape ``(n, n)``, not all empty.
        order: Cells that may vanish, see ``Perturbations.damaged``.
        fraction: Fraction of all modules, or ``_ALL``.
        left: Output, shape ``(n, n)``.
    """
    left[:] = body
    modules = 0
    for place in range(body.size):
        if body.flat[place] != _EMPTY:
            modules += 1
    most = modules if fraction < 0.0 else math.ceil(fraction * modules - ROUNDING)
    lost = 0
    for i in range(len(order)):
        place = order[i]
        if place < 0 or lost >= most or lost == modules - 1:
            return
        if body.flat[place] != _EMPTY:
            left.flat[place] = _EMPTY
            lost += 1


@kernel
def mark_failing(
    body: NDArray[np.int8], order: NDArray[np.int64], fraction: float, fails: NDArray[np.bool_]
) -> None:
    """Mark the wheels that fail, ``(n * n,)``; the rest as in ``lose_cells``."""
    fails[:] = False
    wheels = 0
    for place in range(body.size):
        if body.flat[place] == _WHEEL:
            wheels += 1
    most = wheels if fraction < 0.0 else math.ceil(fraction * wheels - ROUNDING)
    failed = 0
    for i in range(len(order)):
        place = order[i]
        if place < 0 or failed >= most:
            return
        if body.flat[place] == _WHEEL:
            fails[place] = True
            failed += 1


@kernel
def exchange_robot(before: Robot, after: Robot, state: State) -> None:
    """Continue with another body on the same grid, which keeps its place and its motion."""
    own_x = after.center_x - before.center_x
    own_y = after.center_y - before.center_y
    from_x = state.cos * own_x - state.sin * own_y
    from_y = state.sin * own_x + state.cos * own_y
    state.x += from_x
    state.y += from_y
    state.vx -= state.omega * from_y
    state.vy += state.omega * from_x
    state.clearance = 0.0
    state.memory_count = 0


@kernel
def sense_anew(
    before: NDArray[Sensor], world: World, state: State, observation: NDArray[np.floating]
) -> None:
    """Write what another body senses in the place of the one before.

    Touch sensors that both have keep their values.

    Args:
        before: Sensors of the robot before.
        world: The episode's world, with the present robot.
        state: The episode's state.
        observation: Sensor values per cell, ``(n * n,)``, changed.
    """
    touch = np.zeros_like(observation)
    for i in range(len(before)):
        if before[i].senses_touch:
            touch[before[i].place] = observation[before[i].place]
    observation[:] = 0.0
    sense(world, state, observation)
    for i in range(world.robot.sensor_count):
        sensor: Sensor = world.sensors[i]
        if sensor.senses_touch:
            observation[sensor.place] = touch[sensor.place]


@kernel
def add_sensor_noise(
    sensors: NDArray[Sensor],
    perturbation: Perturbation,
    step: int,
    observation: NDArray[np.floating],
) -> None:
    """Add noise to what light and target sensors sense after a step, within 0 and 1.

    Args:
        sensors: Sensors of the robot.
        perturbation: Perturbations of the episode.
        step: Number of steps done.
        observation: Sensor values per cell, ``(n * n,)``, changed.
    """
    for i in range(len(sensors)):
        if sensors[i].senses_touch:  # its last value is its memory
            continue
        place = sensors[i].place
        drawn = normal_value(perturbation.seed, SENSOR_NOISE, step * len(observation) + place)
        value = observation[place] + perturbation.sensor_noise * drawn
        observation[place] = min(max(value, 0.0), 1.0)
