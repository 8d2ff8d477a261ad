"""Controllers by hand that drive any body, better or worse."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.circuit import Circuit, where
from ncrs_envs.body import Cell
from ncrs_envs.tasks import Task

_IO = "input/output"


class Gains(NamedTuple):
    """Numbers that make a controller out of the circuit."""

    gas: float
    """Gas of every wheel, -1 to 1."""
    turn: float
    """Gas per difference of the light sensors beside the hub."""


CONTROLLERS = (Gains(1.0, 0.0), Gains(1.0, 20.0), Gains(1.0, 80.0), Gains(0.0, 0.0))
"""Straight ahead; towards the light, gently and sharply; standing still."""


def hub_circuit(task: Task, gains: Gains) -> Circuit:
    """Wire the cell between two light sensors to compare them, and the wheels to turn by that.

    The comparison spreads from the hub to the left and to the right, and from there to the rear.
    """
    circuit = Circuit(task)
    tap, is_cell = circuit.tap, circuit.is_cell
    light, left, right = (f"hidden {index}" for index in range(1, 4))
    if not gains.turn:
        circuit.set(_IO, gains.gas + 0.0 * tap(_IO))
        return circuit
    between = is_cell(Cell.LIGHT_SENSOR, 0, 1) + is_cell(Cell.LIGHT_SENSOR, 0, -1) - 1
    circuit.set(light, where(between, gains.turn * (tap(_IO, 0, 1) - tap(_IO, 0, -1))))
    turns = []
    for side, column in ((left, 1), (right, -1)):
        near = tap(light, -1, column) + tap(light, 0, column) + tap(light, 1, column)
        turns.append(near + tap(side, 0, column) + tap(side, -1, 0))
        circuit.set(side, turns[-1])
    circuit.set(_IO, gains.gas + turns[0] - turns[1])
    return circuit


@lru_cache(maxsize=4)
def controller_genomes(task: Task) -> NDArray[np.float32]:
    """Return the genomes of ``CONTROLLERS`` for a task, ``(V, num_parameters)``."""
    return np.stack([hub_circuit(task, gains).genome() for gains in CONTROLLERS])
