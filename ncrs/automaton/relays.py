"""Relays: a family of controllers whose steering evolution finds, in a body grown by other units.

A search of all weights hardly finds how to steer by what two sensors see: they differ by a few
hundredths while both rise and fall, so that a step in a weight of one of them changes the common
gas far more than the turn. Relays are linear in the weights and free of that trouble: in every step
each hidden channel of an occupied cell becomes a weighted sum of what its 3 x 3 neighbourhood
holds, where left and right neighbours enter by their sum and by their difference, each with a step
size of its own; a gate, which depends on the parts around, can close the channel. Left and right
are treated alike: hidden channels come in pairs, the second being the mirror image of the first.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import (
    CONTROL_CHANNEL,
    HIDDEN_UNITS,
    KERNEL_SIZE,
    LARGEST_CHANGE,
    NCALayout,
)
from ncrs.automaton.grow_to import GROWTH_UNITS

Values = NDArray[np.float64]

BODIES = {
    "light_chase": "...../LWWWL/WWWWW/WWWWW/L...L",
    "carry_ball": ".W.W./WTWTW/WWWWW/.LWL./.....",
}
"""Bodies to start with, by task: two sensors of a kind beside a cell that can compare them. The
ball fits between the prongs with no room to slide: held there, it is straight ahead, and a robot
that turns towards ball and target at the same time turns towards the target alone."""

RELAYS = 4
"""Number of hidden channels in use, two pairs: a wider search takes longer, and found no more."""

SENSED_STEP, SENSED_CONTRAST_STEP = 1.0, 80.0
"""Step sizes of the weights of the input/output channel, and of its differences."""
HIDDEN_STEP, HIDDEN_CONTRAST_STEP = 0.35, 4.0
"""Step sizes of the weights of hidden channels, and of their differences."""
GAS_STEP = 2.0
"""Step size of the weights with which hidden channels add to a wheel's gas."""
PART_STEP, GATE_STEP = 0.5, 5.0
"""Step sizes of what the parts around add to a sum, and to its gate."""

_MIDDLE = KERNEL_SIZE // 2
_SILENCE = 512.0
"""Bias that keeps the units silent while the body grows; a power of two, which float32 adds
exactly."""


class _Term(NamedTuple):
    """A weight of a channel's sum, or of its gate, in a coordinate."""

    channel: int
    source: int
    row: int
    column: int
    factor: float
    is_gate: bool = False


class RelayMap:
    """Genomes of relays as an affine map of D coordinates: ``base + matrix @ coordinates``.

    With all coordinates 0 every wheel has full gas.

    Args:
        layout: Channels of the task's automaton.
    """

    def __init__(self, layout: NCALayout) -> None:
        self._layout = layout
        places = np.arange(layout.num_parameters)
        layers = [layer[0] for layer in layout.layers(places[None])]
        self._reading, self._silence, self._passing, _, self._writing, _ = layers
        self._hidden = range(layout.part_channels.stop, layout.io_channel)
        self._changing = (*self._hidden, layout.io_channel)
        self._parts = range(layout.channels)[layout.part_channels]
        self.base: Values = self._wiring()
        """Genome without the body, ``(num_parameters,)``."""
        self.matrix: Values = np.stack(
            [self._column(set(terms)) for terms in self._coordinates()], axis=1
        )
        """Change of the genome by coordinate, ``(num_parameters, D)``."""

    @property
    def is_control(self) -> NDArray[np.bool_]:
        """Mask of the weights of all units that are not for growth, ``(num_parameters,)``."""
        first, second = (HIDDEN_UNITS - spared for spared in GROWTH_UNITS)
        mask = np.zeros(self._layout.num_parameters, dtype=bool)
        for places in (
            self._reading[:first], self._silence[:first], self._passing[:second],
            self._passing[:, :first], self._writing[:, :second],
        ):  # fmt: skip
            mask[places] = True
        return mask

    def coordinates_of(self, genome: Values) -> Values | None:
        """Return the coordinates ``(D,)`` of a genome ``(num_parameters,)``; None if it has none.

        A genome in which only the units for growth have weights has zeros.
        """
        control = np.where(self.is_control, genome, 0.0)
        if not control.any():
            return np.zeros(self.matrix.shape[1])
        difference = control - self.base
        found = np.linalg.lstsq(self.matrix, difference, rcond=None)[0]
        coordinates = np.asarray(found, dtype=np.float64)
        missed = np.abs(self.matrix @ coordinates - difference)
        # A genome is kept in float32: near the silencing bias that is good to some 3e-5.
        return coordinates if missed.max() < 1e-3 else None

    def _units(self, channel: int) -> tuple[int, int]:
        """Units of the first layer for the positive and the negative part of a channel's change."""
        first = 1 + 2 * self._changing.index(channel)
        return first, first + 1

    def _wiring(self) -> Values:
        """Wire all but the weights that are searched: changes, signs, silence during growth."""
        genome = np.zeros(self._layout.num_parameters)
        # The first unit of each layer is 1 while the robot drives.
        genome[self._reading[0, CONTROL_CHANNEL, _MIDDLE, _MIDDLE]] = 1.0
        genome[self._passing[0, 0]] = 1.0
        for index, channel in enumerate(self._changing):
            unit = 1 + index
            for place, sign in zip(self._units(channel), (1.0, -1.0), strict=True):
                flag = self._reading[place, CONTROL_CHANNEL, _MIDDLE, _MIDDLE]
                genome[flag] = _SILENCE + sign * (channel == self._layout.io_channel)
                genome[self._silence[place]] = -_SILENCE
                genome[self._reading[place, channel, _MIDDLE, _MIDDLE]] = -sign
                genome[self._passing[unit, place]] = sign
            genome[self._passing[unit, 0]] = LARGEST_CHANGE
            genome[self._writing[channel, unit]] = 1.0
            genome[self._writing[channel, 0]] = -LARGEST_CHANGE
        return genome

    def _partner(self, channel: int) -> int:
        if channel not in self._hidden:
            return channel
        return self._hidden[(channel - self._hidden.start) ^ 1]

    def _mirrored(self, term: _Term) -> _Term:
        return term._replace(
            channel=self._partner(term.channel),
            source=self._partner(term.source),
            column=KERNEL_SIZE - 1 - term.column,
        )

    def _column(self, terms: set[_Term]) -> Values:
        """Change of the genome by a coordinate: its terms and their mirror images."""
        column = np.zeros(self._layout.num_parameters)
        for term in terms | {self._mirrored(term) for term in terms}:
            for unit, sign in zip(self._units(term.channel), (1.0, -1.0), strict=True):
                place = self._reading[unit, term.source, term.row, term.column]
                column[place] += term.factor if term.is_gate else sign * term.factor
        return column

    def _coordinates(self) -> Iterator[Iterable[_Term]]:
        """List the terms of each coordinate; mirror images go without saying."""
        gas = self._layout.io_channel
        for channel in self._hidden[:RELAYS:2]:
            for source in self._hidden[:RELAYS]:
                contrast = HIDDEN_STEP if source == channel else HIDDEN_CONTRAST_STEP
                yield from _row_terms(channel, source, HIDDEN_STEP, contrast)
            yield from _row_terms(channel, gas, SENSED_STEP, SENSED_CONTRAST_STEP)
            for source in self._parts:
                for row, column in np.ndindex(KERNEL_SIZE, KERNEL_SIZE):
                    if row == column == _MIDDLE:
                        yield [_Term(channel, source, row, column, PART_STEP)]
                    yield [_Term(channel, source, row, column, GATE_STEP, is_gate=True)]
            # The control flag, 1 while the robot drives, stands for a constant.
            yield [_Term(channel, CONTROL_CHANNEL, _MIDDLE, _MIDDLE, PART_STEP)]
            yield [_Term(channel, CONTROL_CHANNEL, _MIDDLE, _MIDDLE, GATE_STEP, is_gate=True)]
        for source in self._hidden[:RELAYS:2]:
            for row, column in np.ndindex(KERNEL_SIZE, KERNEL_SIZE):
                yield [_Term(gas, source, row, column, GAS_STEP)]
        for source in (*self._parts, gas):
            for row, column in np.ndindex(KERNEL_SIZE, _MIDDLE + 1):
                yield [_Term(gas, source, row, column, PART_STEP)]
        yield [_Term(gas, CONTROL_CHANNEL, _MIDDLE, _MIDDLE, PART_STEP)]


def _row_terms(
    channel: int, source: int, step: float, contrast: float
) -> Iterator[Iterable[_Term]]:
    """Yield, for each row, the middle neighbour, the sum of the others, and their difference."""
    for row in range(KERNEL_SIZE):
        yield [_Term(channel, source, row, _MIDDLE, step)]
        left, right = 0, KERNEL_SIZE - 1
        yield [_Term(channel, source, row, column, step) for column in (left, right)]
        yield [
            _Term(channel, source, row, left, -contrast),
            _Term(channel, source, row, right, contrast),
        ]
