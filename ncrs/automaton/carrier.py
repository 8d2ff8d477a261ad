"""A robot by hand that carries the ball: its body, and a circuit that steers it.

The light sensors at its rear see the ball; two target sensors on prongs see the target, and the
ball is carried between the prongs. Behind the wheels, the difference of what the light sensors see
tells where the ball is, their sum whether it is caught; in front, the target sensors' difference
tells where the target is. The cell between the wheels chooses which to follow, and the turn spreads
from there to both sides.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.circuit import Circuit, Signal, ramp, relu, where
from ncrs.automaton.grow_to import grow_to
from ncrs_envs.body import Cell

TASK = "carry_ball"
BODY = "T...T/WWWWW/WWWWW/.LWL./....."
GAINS = {
    "ball": 60.0,
    "caught": 1.75,
    "switch": 0.1,
    "target": 10.0,
    "spread": 1.0,
    "second_row": 1.0,
    "turn": 1.0,
    "gas": 1.0,
}
"""Gains chosen by thought; a search from them is ``experiment=best/carry_ball_compiled``."""
_SURE = 20.0
_IO = "input/output"


def carrier_circuit(gains: Mapping[str, float]) -> Circuit:
    """Wire the carrier.

    Args:
        gains: Values by the names of ``GAINS``: turn per difference of the light sensors; their sum
            from which the ball counts as caught, and the width of that switch; turn per difference
            of the target sensors; how much of the turn the next wheel gets, and the wheels of the
            first row; gas per turn; gas straight ahead.
    """
    circuit = Circuit(TASK)
    tap = circuit.tap
    ball, seen, target, turn, left, right = (f"hidden {index}" for index in range(1, 7))

    # Between the light sensors: where the ball is (elsewhere noise, which nobody reads), and how
    # near.
    circuit.set(ball, gains["ball"] * (tap(_IO, 0, 1) - tap(_IO, 0, -1)))
    both = circuit.is_cell(Cell.LIGHT_SENSOR, 0, 1) + circuit.is_cell(Cell.LIGHT_SENSOR, 0, -1)
    circuit.set(seen, relu(tap(_IO, 0, 1) + tap(_IO, 0, -1) + _SURE * (both - 2)))

    # Behind the prongs: what each target sensor sees, the left one with the other sign.
    def prong(column: int) -> Signal:
        sensor = circuit.is_cell(Cell.TARGET_SENSOR, -1, column)
        return relu(tap(_IO, -1, column) + _SURE * (sensor - 1))

    circuit.set(target, prong(1) - prong(-1))

    # In the middle: the turn, towards the target once the ball is caught.
    near = tap(seen, 1, 0)
    caught = ramp(near, gains["caught"] - abs(gains["switch"]), gains["caught"])
    here = ramp(near, 0.0, 0.2)
    goal = tap(target, -1, -1) + tap(target, -1, 1)
    circuit.set(turn, where(caught, gains["target"] * goal) + where(here - caught, tap(ball, 1, 0)))

    # Outwards from there, one cell a step.
    def side(channel: str, column: int) -> Signal:
        near_turn = tap(turn, 0, column) + gains["second_row"] * tap(turn, 1, column)
        return near_turn + gains["spread"] * tap(channel, 0, column)

    to_left, to_right = side(left, 1), side(right, -1)
    circuit.set(left, to_left)
    circuit.set(right, to_right)
    circuit.set(_IO, gains["gas"] + gains["turn"] * (to_left - to_right))
    return circuit


class Carrier:
    """Genomes of the carrier for any gains; the weights that grow its body are found once."""

    def __init__(self) -> None:
        self._body = grow_to(BODY, TASK)

    def __call__(self, gains: Mapping[str, float]) -> NDArray[np.float32]:
        """Return the genome for gains by the names of ``GAINS``."""
        return carrier_circuit(gains).genome() + self._body
