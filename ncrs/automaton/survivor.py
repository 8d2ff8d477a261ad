"""Robots by hand that go on after damage: bodies with spare parts, or that grow back.

Wherever a wheel stands between two light sensors, it compares them, whatever else is left of the
robot; the comparisons spread to the left, to the right and to the rear, and add up. The chaser
(``ncrs.automaton.chaser``) is the smallest of these robots.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.chaser import BODY, TASK
from ncrs.automaton.circuit import Circuit, where
from ncrs.automaton.grow_to import grow_to
from ncrs_envs.body import Cell

SPARE_BODY = "LWLWL/WWWWW/LWLWL/WWWWW/....."
"""Body with four pairs of light sensors."""
REPAIR_BODY = BODY
REPAIR_STEPS = 10
REPAIR_UNITS = (14, 22)
"""Units of the two layers for growth and repair; the circuit needs few."""
GAINS = {"gain": 80.0, "spread": 1.0, "rear": 1.0, "gas": 1.0}
"""Gains chosen by thought; searches from them are ``experiment=robust/...``."""
_IO = "input/output"


def survivor_circuit(gains: Mapping[str, float]) -> Circuit:
    """Wire a survivor.

    Args:
        gains: Values by the names of ``GAINS``: turn per difference of two light sensors; how much
            of the turn the next cell to the side gets; how much the cells behind get; gas straight
            ahead.
    """
    circuit = Circuit(TASK)
    tap, is_cell = circuit.tap, circuit.is_cell
    light, left, right = (f"hidden {index}" for index in range(1, 4))
    between = is_cell(Cell.LIGHT_SENSOR, 0, 1) + is_cell(Cell.LIGHT_SENSOR, 0, -1) - 1
    circuit.set(light, where(between, gains["gain"] * (tap(_IO, 0, 1) - tap(_IO, 0, -1))))
    to_left = gains["rear"] * tap(light, -1, 1) + gains["spread"] * tap(left, 0, 1)
    to_right = gains["rear"] * tap(light, -1, -1) + gains["spread"] * tap(right, 0, -1)
    circuit.set(left, to_left)
    circuit.set(right, to_right)
    circuit.set(_IO, gains["gas"] + to_left - to_right)
    return circuit


class Survivor:
    """Genomes of a survivor for any gains; the weights that grow its body are found once.

    Args:
        body: Body in any form that ``parse_body`` reads.
        repair_steps: Steps of growth in which it regrows; 0 for a robot that does not.
    """

    def __init__(self, body: str, repair_steps: int = 0) -> None:
        self._body = grow_to(body, TASK, units=REPAIR_UNITS, repair_steps=repair_steps)

    def __call__(self, gains: Mapping[str, float]) -> NDArray[np.float32]:
        """Return the genome for gains by the names of ``GAINS``."""
        genome: NDArray[np.float32] = survivor_circuit(gains).genome(REPAIR_UNITS) + self._body
        return genome
