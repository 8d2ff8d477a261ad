"""Genomes by hand: circuits of signals between cells, written into the weights of an NCA."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import (
    CONTROL_CHANNEL,
    FIRST_PART_CHANNEL,
    HIDDEN_UNITS,
    KERNEL_SIZE,
    LARGEST_CHANGE,
    STATE_LIMIT,
    nca_layout,
)
from ncrs.automaton.grow_to import GROWTH_UNITS
from ncrs_envs.body import Cell
from ncrs_envs.errors import NCRSError
from ncrs_envs.tasks import Task

LAYERS = 2
"""Hidden layers: a signal can pass that many rectifiers within a step."""


class CircuitError(NCRSError, ValueError):
    """A circuit that an NCA of this size cannot hold, or that names what does not exist."""


@dataclass(frozen=True)
class Tap:
    """The value of a channel in a cell of the 3 x 3 neighbourhood, before the step."""

    channel: int
    row: int
    """-1 ahead, 0 or 1 behind."""
    column: int
    """-1 to the left, 0 or 1 to the right."""

    @property
    def range(self) -> tuple[float, float]:
        """Smallest and largest value during control."""
        is_fixed = self.channel != CONTROL_CHANNEL and self.channel < FIRST_PART_CHANNEL
        return (0.0, 1.0) if is_fixed else (-STATE_LIMIT, STATE_LIMIT)


@dataclass(frozen=True)
class Unit:
    """A rectifier: ``max(0, signal)``."""

    signal: Signal

    @property
    def range(self) -> tuple[float, float]:
        """Smallest and largest value."""
        low, high = self.signal.range
        return max(0.0, low), max(0.0, high)


@dataclass(frozen=True)
class Signal:
    """A sum of taps, or of rectifiers of one layer, with weights, and a constant.

    Signals are added, subtracted, and multiplied by numbers; one of an earlier layer is carried to
    the later one.
    """

    layer: int
    """0 for a sum of taps; 1 or 2 for one of the rectifiers of that hidden layer."""
    terms: frozenset[tuple[Tap | Unit, float]]
    constant: float = 0.0

    @property
    def range(self) -> tuple[float, float]:
        """Bounds of the value, which the actual extremes may not reach."""
        low = high = self.constant
        for term, weight in self.terms:
            ends = sorted(weight * end for end in term.range)
            low, high = low + ends[0], high + ends[1]
        return low, high

    def at(self, layer: int, cut: float = -math.inf) -> Signal:
        """Carry this signal to a later layer, unchanged, but for values below ``cut``.

        Values below become ``cut``; the higher it is, the smaller are the weights.
        """
        if self.layer >= layer:
            return self
        low = min(0.0, max(cut, self.range[0]))
        return (relu(self - low) + low).at(layer, cut)

    def __add__(self, other: Signal | float) -> Signal:
        if not isinstance(other, Signal):
            return Signal(self.layer, self.terms, self.constant + float(other))
        layer = max(self.layer, other.layer)
        one, two = self.at(layer), other.at(layer)
        weights: dict[Tap | Unit, float] = dict(one.terms)
        for term, weight in two.terms:
            weights[term] = weights.get(term, 0.0) + weight
        return Signal(layer, _frozen(weights), one.constant + two.constant)

    def __mul__(self, factor: float) -> Signal:
        weights = {term: weight * float(factor) for term, weight in self.terms}
        return Signal(self.layer, _frozen(weights), self.constant * float(factor))

    def __neg__(self) -> Signal:
        return self * -1.0

    def __sub__(self, other: Signal | float) -> Signal:
        return self + -other

    __radd__ = __add__
    __rmul__ = __mul__

    def __rsub__(self, other: float) -> Signal:
        return -self + other


def _frozen(weights: Mapping[Tap | Unit, float]) -> frozenset[tuple[Tap | Unit, float]]:
    return frozenset((term, weight) for term, weight in weights.items() if weight)


def relu(signal: Signal) -> Signal:
    """Rectify: ``max(0, signal)``, a signal of the next layer.

    Raises:
        CircuitError: If there is no next layer.
    """
    if signal.layer >= LAYERS:
        raise CircuitError(
            f"A signal can pass {LAYERS} rectifiers within a step; store it in a hidden channel, "
            "and go on in the next step."
        )
    return Signal(signal.layer + 1, frozenset({(Unit(signal), 1.0)}))


def ramp(signal: Signal, start: float, end: float) -> Signal:
    """Make a switch: 0 up to ``start``, 1 from ``end``, linear between.

    Raises:
        CircuitError: If ``end`` is not above ``start``, or there is no next layer.
    """
    if not end > start:
        raise CircuitError(f"A ramp must end above its start, got {start} to {end}.")
    slope = 1.0 / (end - start)
    return relu((signal - start) * slope) - relu((signal - end) * slope)


def where(switch: Signal, signal: Signal) -> Signal:
    """Let a signal pass where a switch is 1, and be 0 where the switch is 0 or less.

    Args:
        switch: Signal that never exceeds 1, such as a ``ramp`` or ``Circuit.is_cell``.
        signal: Signal to pass; the result is of the layer after both.
    """
    layer = max(switch.layer, signal.layer)
    switch, signal = switch.at(layer), signal.at(layer)
    low, high = signal.range
    low = min(0.0, low)
    passed = relu(signal - low + (switch - 1.0) * (high - low))
    return passed + relu(switch) * low if low else passed


class Circuit:
    """A circuit for the cells of a task's robots: it says what channels become in every step.

    It works during control alone. A robot needs a body, too: ``grow_to`` finds a genome that grows
    one with other units, and the sum of both genomes grows it and drives it.

    Args:
        task: Task or its name.

    Raises:
        TaskError: The task is unknown.
    """

    def __init__(self, task: str | Task = "light_chase") -> None:
        self._layout = nca_layout(task)
        self._changes: dict[int, Signal] = {}

    def tap(self, channel: str, row: int = 0, column: int = 0) -> Signal:
        """Read a channel in a cell of the neighbourhood.

        Args:
            channel: Name of the channel, one of ``NCALayout.channel_names``.
            row: -1 ahead of this cell, 0, or 1 behind it.
            column: -1 to the left, 0, or 1 to the right.

        Raises:
            CircuitError: If there is no such channel or neighbour.
        """
        return self._tap(self._index(channel), row, column)

    def is_cell(self, cell: Cell, row: int = 0, column: int = 0) -> Signal:
        """Make a switch that is 1 if a cell of the neighbourhood is of a type, else 0.

        Raises:
            CircuitError: If the task has no such cells, or there is no such neighbour.
        """
        codes = self._layout.part_codes
        if cell not in codes:
            raise CircuitError(f"{self._layout.task.name} has no {Cell(cell).label} cells.")
        return self._tap(FIRST_PART_CHANNEL + codes.index(int(cell)), row, column)

    def set(self, channel: str, signal: Signal) -> None:
        """Let a channel become a signal's value in every step, in every occupied cell.

        Args:
            channel: Name of a hidden channel or "input/output"; channels that are not set keep
                their values. In sensor cells, observations overwrite the input/output channel; in
                wheel cells it is the gas.
            signal: Next value; states are clipped to [-5, 5].

        Raises:
            CircuitError: If the channel does not exist, cannot change during control, or is set
                already.
        """
        index = self._index(channel)
        changing = range(self._layout.channels)[self._layout.changing_channels]
        if index not in changing:
            names = [self._layout.channel_names[other] for other in changing]
            raise CircuitError(f"{channel} does not change during control; set one of {names}.")
        if index in self._changes:
            raise CircuitError(f"{channel} is set already.")
        change = signal - self._tap(index, 0, 0)
        self._changes[index] = change.at(LAYERS, -LARGEST_CHANGE)

    def _index(self, channel: str) -> int:
        names = self._layout.channel_names
        if channel not in names:
            raise CircuitError(f"There is no channel {channel!r}; there are {names}.")
        return names.index(channel)

    def _tap(self, channel: int, row: int, column: int) -> Signal:
        if not {row, column} <= {-1, 0, 1}:
            raise CircuitError(f"row and column must be -1, 0 or 1, got {row!r} and {column!r}.")
        return Signal(0, frozenset({(Tap(channel, row, column), 1.0)}))

    def genome(self, spared: tuple[int, int] = GROWTH_UNITS) -> NDArray[np.float32]:
        """Write the circuit into the first units of each layer of a genome.

        Args:
            spared: Number of units of the first and of the second layer that stay 0, for growth.

        Returns:
            The genome, float32 ``(num_parameters,)``.

        Raises:
            CircuitError: If the circuit needs more units than the others.
        """
        genome: NDArray[np.float32] = np.zeros((1, self._layout.num_parameters), dtype=np.float32)
        layers = [layer[0] for layer in self._layout.layers(genome)]
        _Writer(self._changes, spared).write(layers)
        return genome.reshape(-1)


class _Writer:
    """Places of a circuit's rectifiers among the units, and their weights.

    Growth has the control flag 0: then nothing of the circuit may be active. A constant therefore
    comes from the flag, in later layers by way of a unit that carries it.
    """

    def __init__(self, changes: Mapping[int, Signal], spared: tuple[int, int]) -> None:
        self._changes = changes
        self._first: dict[Unit, int] = {}
        self._second: dict[Unit, int] = {}
        self._one = Unit(Signal(0, frozenset({(Tap(CONTROL_CHANNEL, 0, 0), 1.0)})))
        self._one_carried = Unit(Signal(1, frozenset({(self._one, 1.0)})))
        for signal in changes.values():
            self._place(signal)
        for count, units, spare in zip(
            ("first", "second"), (self._first, self._second), spared, strict=True
        ):
            if len(units) > HIDDEN_UNITS - spare:
                raise CircuitError(
                    f"The circuit needs {len(units)} units of the {count} layer, which has "
                    f"{HIDDEN_UNITS - spare} beside those for growth; share signals between "
                    "channels, or store some of them."
                )

    def _unit_of_constant(self, signal: Signal) -> Unit | None:
        """Return the unit that brings a signal's constant; None if the flag or a bias can."""
        if signal.layer == LAYERS:
            return self._one_carried if signal.constant else None
        return self._one if signal.layer and signal.constant > 0 else None

    def _place(self, signal: Signal) -> None:
        one = self._unit_of_constant(signal)
        if one is not None:
            signal = Signal(signal.layer, signal.terms | {(one, signal.constant)})
        for term, _ in sorted(signal.terms, key=repr):
            if isinstance(term, Unit):
                self._place(term.signal)
                places = self._second if signal.layer == LAYERS else self._first
                places.setdefault(term, len(places))

    def write(self, layers: Sequence[NDArray[np.float32]]) -> None:
        """Write the weights into the layers of a genome, see ``NCALayout.layers``."""
        reading, bias1, middle, bias2, writing, _ = layers
        cell = KERNEL_SIZE // 2
        for unit, place in self._first.items():
            weights = sum(abs(weight) for _, weight in unit.signal.terms)
            # Without the flag the unit is silent, whatever the states are; with it, exact.
            silence = 0.0 if unit == self._one else STATE_LIMIT * weights
            for tap, weight in unit.signal.terms:
                assert isinstance(tap, Tap)
                reading[place, tap.channel, cell + tap.row, cell + tap.column] += weight
            reading[place, CONTROL_CHANNEL, cell, cell] += unit.signal.constant + silence
            bias1[place] = -silence
        for unit, place in self._second.items():
            for term, weight in unit.signal.terms:
                assert isinstance(term, Unit)
                middle[place, self._first[term]] = weight
            one = self._unit_of_constant(unit.signal)
            if one is not None:
                middle[place, self._first[one]] += unit.signal.constant
            else:
                bias2[place] = unit.signal.constant
        for channel, signal in self._changes.items():
            for term, weight in signal.terms:
                assert isinstance(term, Unit)
                writing[channel, self._second[term]] = weight
            one = self._unit_of_constant(signal)
            if one is not None:
                writing[channel, self._second[one]] += signal.constant
