"""Sizes of shards: large enough to be worth a message, small enough to be taken over."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import NamedTuple

from ncrs.engines.base import CUDA_ENGINE
from ncrs.engines.cluster.crew import Seat

_TURNS = 4
"""A worker gets this part of its fair share of what is left; so shards become smaller."""


class _Grain(NamedTuple):
    least: int
    """Fewest genomes per thread of a worker."""
    most: int
    """Most genomes per thread, about half a second of work."""
    per_message: float
    """Genomes that a thread evaluates while the sender handles one message."""


_GRAINS = {
    "batched": _Grain(8, 64, 0.5),
    "box2d": _Grain(1, 4, 0.02),
    CUDA_ENGINE: _Grain(256, 1024, 200.0),
}
_OTHER = _Grain(1, 16, 0.5)


def shard_size(seat: Seat, seats: Sequence[Seat], left: int, population: int, engine: str) -> int:
    """Choose the number of genomes to send to a seat; results do not depend on it.

    Args:
        seat: The seat.
        seats: All seats, this one among them.
        left: Number of genomes that were not sent yet, at least 1.
        population: Number of genomes of the whole population.
        engine: Name of the engine on the workers.
    """
    grain = _GRAINS.get(engine, _OTHER)
    threads = sum(each.threads for each in seats)
    fair = ceil(population * seat.threads / threads)
    turn = ceil(left * seat.threads / (threads * _TURNS))
    least = max(grain.least * seat.threads, round(grain.per_message * len(seats)))
    return min(left, fair, max(least, min(turn, grain.most * seat.threads)))
