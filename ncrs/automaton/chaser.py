"""A robot by hand that turns towards the light, wherever that goes: its body, and its circuit.

The wheel between the two light sensors compares them; the comparison spreads to the left and to the
right; each wheel adds it to, or subtracts it from, the gas.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.circuit import Circuit, where
from ncrs.automaton.grow_to import grow_to
from ncrs_envs.body import Cell

TASK = "light_chase"
BODY = "...../.LWL./WWWWW/...../....."
GAIN = 150.0
"""Turn per difference of the two light sensors; less turns about slowly, more wavers."""
FITNESS, SUCCESS, EPISODES = 0.734, 1.0, 1000
"""Result of ``ncrs.evaluate(chaser_genome(), "light_chase", episodes=1000)``."""
_IO = "input/output"


def chaser_circuit(gain: float = GAIN) -> Circuit:
    """Wire the chaser, with its turn per difference of the sensors."""
    circuit = Circuit(TASK)
    tap, is_cell = circuit.tap, circuit.is_cell
    light, left, right = (f"hidden {index}" for index in range(1, 4))
    between = is_cell(Cell.LIGHT_SENSOR, 0, 1) + is_cell(Cell.LIGHT_SENSOR, 0, -1) - 1
    circuit.set(light, where(between, gain * (tap(_IO, 0, 1) - tap(_IO, 0, -1))))
    # From ahead, and from the next wheel towards the middle.
    to_left = tap(light, -1, 1) + tap(left, 0, 1)
    to_right = tap(light, -1, -1) + tap(right, 0, -1)
    circuit.set(left, to_left)
    circuit.set(right, to_right)
    circuit.set(_IO, 1 + to_left - to_right)
    return circuit


def chaser_genome(gain: float = GAIN) -> NDArray[np.float32]:
    """Make the genome that grows the chaser's body and drives it."""
    genome: NDArray[np.float32] = chaser_circuit(gain).genome() + grow_to(BODY, TASK)
    return genome
