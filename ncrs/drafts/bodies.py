"""Bodies drawn at random for given measures, in two families that suit the controllers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.body import BodyGrid, Cell
from ncrs_envs.tasks import Task

Place = tuple[int, int]

_ARROW = 0.3
"""Fraction of arrows among the bodies; the others have a hub."""
_WHEEL_HUB = 0.7
_WHEELS_FIRST = 0.8
_BEHIND_HUB = 0.7


def draw_body(
    task: Task, measures: Sequence[int], grid_size: int, generator: np.random.Generator
) -> BodyGrid:
    """Draw a body with given measures.

    Most have a hub: a cell between two light sensors, with the wheels in mirrored pairs, by
    preference behind it. The others are arrows: narrow, with the sensors in front.

    Args:
        task: Task whose bodies are drawn.
        measures: Number of sensors, wheels and cells, of a triple that valid bodies can have.
        grid_size: Side n of the grid.
        generator: Source of the choices.

    Returns:
        Cell codes, int8 ``(n, n)``, valid for the task.
    """
    sensors, wheels, cells = measures
    parts = [Cell.LIGHT_SENSOR] * sensors + [Cell.WHEEL] * wheels
    parts += [Cell.TISSUE] * (cells - sensors - wheels)
    drawing = _Drawing(grid_size, parts, generator)
    if generator.random() < _ARROW:
        drawing.fill_arrow()
    else:
        drawing.place_hub()
        drawing.fill_pairs()
    body = drawing.body
    for cell, needed in task.required_parts:
        if cell not in (Cell.LIGHT_SENSOR, Cell.WHEEL):
            _exchange(body, cell, needed, drawing.flanks, generator)
    return body


class _Drawing:
    """A body on its way, and the parts that are not placed yet."""

    def __init__(self, size: int, parts: Iterable[Cell], generator: np.random.Generator) -> None:
        self.body = np.zeros((size, size), dtype=np.int8)
        self.flanks: list[Place] = []
        """The light sensors beside the hub."""
        self._size, self._middle = size, size // 2
        self._left = list(parts)
        self._generator = generator
        self._hub_row = -1

    def _put(self, part: Cell, place: Place) -> None:
        self._left.remove(part)
        self.body[place] = part

    def _is_free(self, place: Place) -> bool:
        inside = all(0 <= index < self._size for index in place)
        return inside and self.body[place] == Cell.EMPTY

    def place_hub(self) -> None:
        """Place two light sensors with a cell between them, if there are enough parts."""
        hubs: list[Cell] = [part for part in (Cell.WHEEL, Cell.TISSUE) if part in self._left]
        if self._left.count(Cell.LIGHT_SENSOR) > 2:
            hubs.append(Cell.LIGHT_SENSOR)
        if self._left.count(Cell.LIGHT_SENSOR) < 2 or not hubs:
            return
        first = self._generator.random() < _WHEEL_HUB
        hub = hubs[0] if first else hubs[int(self._generator.integers(len(hubs)))]
        row = self._hub_row = int(self._generator.integers(self._size - 1))
        self.flanks = [(row, self._middle - 1), (row, self._middle + 1)]
        for place in self.flanks:
            self._put(Cell.LIGHT_SENSOR, place)
        self._put(hub, (row, self._middle))

    def fill_pairs(self) -> None:
        """Place the other parts in mirrored pairs, odd ones in the middle column."""
        others = [Cell.LIGHT_SENSOR, Cell.WHEEL]
        if self._generator.random() < _WHEELS_FIRST:
            others.reverse()
        pairs, single = self._pairs(), self._middle_places()
        for part in (*others, Cell.TISSUE):
            if self._left.count(part) % 2 and single:
                self._put(part, single.pop())
            while self._left.count(part) > 1 and pairs:
                for place in pairs.pop(0):
                    self._put(part, place)
            while part in self._left and single:
                self._put(part, single.pop())
        # What is left fits into broken pairs, and into the columns that an even side has more.
        places = [place for place in np.ndindex(self._size, self._size) if self._is_free(place)]
        for part, index in zip(
            list(self._left), self._generator.permutation(len(places)), strict=False
        ):
            self._put(part, places[index])

    def _pairs(self) -> list[tuple[Place, Place]]:
        """Free mirrored places in random order, those behind the hub first, as a rule."""
        pairs = [
            ((row, self._middle - offset), (row, self._middle + offset))
            for row in range(self._size)
            for offset in range(1, self._middle + 1)
        ]
        free = [pair for pair in pairs if all(map(self._is_free, pair))]
        shuffled = [free[index] for index in self._generator.permutation(len(free))]
        if self.flanks and self._generator.random() < _BEHIND_HUB:
            behind = (self._hub_row + 1, self._hub_row + 2)
            shuffled.sort(
                key=lambda pair: (
                    (pair[0][0], -pair[0][1]) if pair[0][0] in behind else (self._size, 0)
                )
            )
        return shuffled

    def _middle_places(self) -> list[Place]:
        free = [(row, self._middle) for row in range(self._size)]
        free = [place for place in free if self._is_free(place)]
        return [free[index] for index in self._generator.permutation(len(free))]

    def fill_arrow(self) -> None:
        """Place all parts: narrow, from the middle column outwards, or with a broad rear."""
        places = list(np.ndindex(self._size, self._size))
        rear_first = self._generator.random() < 0.5
        wheels_outside = self._generator.random() < 0.5

        def off(place: Place) -> int:
            return abs(place[1] - self._middle)

        def order(place: Place) -> tuple[int, int]:
            """Sort by the distance from the middle column, then, for a broad rear, by the row."""
            row = self._size - 1 - place[0] if rear_first and off(place) else 0
            return off(place), row

        chosen = sorted(places, key=order)[: len(self._left)]
        chosen.sort(key=lambda place: (-off(place) if wheels_outside else 0, -place[0]))
        ordered = sorted(self._left, key=[Cell.WHEEL, Cell.LIGHT_SENSOR, Cell.TISSUE].index)
        for part, place in zip(ordered, chosen, strict=True):
            self._put(part, place)


def _exchange(
    body: NDArray[np.int8],
    sensor: Cell,
    needed: int,
    kept: Sequence[Place],
    generator: np.random.Generator,
) -> None:
    """Turn some light sensors, at random, into sensors of another kind."""
    places = [tuple(place) for place in np.argwhere(body == Cell.LIGHT_SENSOR).tolist()]
    free = [place for place in places if place not in kept]
    most = min(len(places) - 1, max(len(free), needed))  # a light sensor is needed, too
    chosen = int(generator.integers(needed, most + 1))
    order = [*(free[index] for index in generator.permutation(len(free))), *kept]
    for place in order[:chosen]:
        body[place] = sensor
