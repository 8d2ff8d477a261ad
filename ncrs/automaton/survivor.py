"""Robots by hand that go on after damage: bodies with spare parts, or that grow back.

Wherever a wheel stands between two light sensors, it compares them, whatever else is left of the
robot; the comparisons spread to the left, to the right and to the rear, and add up. The chaser
(``ncrs.automaton.chaser``) is the smallest of these robots.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.chaser import BODY, TASK
from ncrs.automaton.circuit import Circuit, Signal, where
from ncrs.automaton.grow_to import grow_to
from ncrs.automaton.regrow_to import REPAIR_UNITS, regrow_to
from ncrs_envs.body import Cell

SPARE_BODY = "...../LWLWL/WWWWW/...../....."
"""Body with two pairs of light sensors, and no cell that is not a sensor or a wheel."""
REPAIR_BODY = BODY
GAINS = {
    "across": 150.0,
    "beside": 150.0,
    "spread": 0.6,
    "diagonal": 0.4,
    "rear": 1.0,
    "gas": 1.0,
}
"""Gains chosen by thought; searches from them are ``experiment=robust/...``."""
_IO = "input/output"


def survivor_circuit(gains: Mapping[str, float]) -> Circuit:
    """Wire a survivor.

    Args:
        gains: Values by the names of ``GAINS``: turn per difference of two light sensors with a
            cell between them, and of two side by side; how much of the turn the next cell to the
            side gets, and those diagonally beside it; how much the cells behind get; gas straight
            ahead.
    """
    circuit = Circuit(TASK)
    tap, is_cell = circuit.tap, circuit.is_cell
    light, left, right = (f"hidden {index}" for index in range(1, 4))
    here, to_its_left, to_its_right = (is_cell(Cell.LIGHT_SENSOR, 0, by) for by in (0, -1, 1))
    across = gains["across"] * (tap(_IO, 0, 1) - tap(_IO, 0, -1))
    beside = gains["beside"] * (tap(_IO, 0, 1) - tap(_IO, 0, 0))
    circuit.set(
        light,
        where(to_its_left + to_its_right - 1, across) + where(here + to_its_right - 1, beside),
    )

    def from_side(channel: str, column: int) -> Signal:
        aside = tap(channel, -1, column) + tap(channel, 1, column)
        turn = gains["rear"] * tap(light, -1, column) + gains["diagonal"] * aside
        return turn + gains["spread"] * tap(channel, 0, column)

    to_left, to_right = from_side(left, 1), from_side(right, -1)
    circuit.set(left, to_left)
    circuit.set(right, to_right)
    circuit.set(_IO, gains["gas"] + to_left - to_right)
    return circuit


class Survivor:
    """Genomes of a survivor for any gains; the weights that grow its body are found once.

    Args:
        body: Body in any form that ``parse_body`` reads.
        regrows: True for one that regrows what it loses, in ``REPAIR_STEPS`` of growth.
    """

    def __init__(self, body: str, regrows: bool = False) -> None:
        find = regrow_to if regrows else partial(grow_to, units=REPAIR_UNITS)
        self._body = find(body, TASK)

    def __call__(self, gains: Mapping[str, float]) -> NDArray[np.float32]:
        """Return the genome for gains by the names of ``GAINS``."""
        genome: NDArray[np.float32] = survivor_circuit(gains).genome(REPAIR_UNITS) + self._body
        return genome
