"""Random streams: one seed is split into a stream for each purpose.

The numbers of a stream never depend on other streams, on the engine, or on the number of workers.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs.evolution.archive import SEED_LENGTH
from ncrs_envs.errors import NCRSError

MAX_SEED = 2**63 - 1
"""Largest seed, since archives keep seeds as int64."""
_FILL = -1


class SeedError(NCRSError, ValueError):
    """A seed that is out of range, or numbers that identify no stream."""


class Stream(IntEnum):
    """First key of every stream. Archives hold these numbers: none may change its purpose."""

    OPTIMIZER = 0
    """All that the optimizer draws."""
    SCENARIOS = 1
    """A generation's scenarios. Further keys: the generation, and the genome's index where each
    genome has its own."""
    CHAMPION = 2
    """Scenarios that a run's candidates for champion are compared on."""
    ASSESSMENT = 3
    """Fresh episodes that a robot is tested on."""
    REESTIMATION = 4
    """Scenarios that a run estimates its elites on again. Further key: the generation."""
    COMMAND_REESTIMATION = 5
    """The same for ``ncrs archive --reestimate``."""
    REPORT = 6
    """Episodes of a report."""


def check_seed(seed: Any) -> int:
    """Return the seed if it is an integer in range, else raise ``SeedError``."""
    is_integer = isinstance(seed, int | np.integer) and not isinstance(seed, bool)
    if not is_integer or not 0 <= seed <= MAX_SEED:
        raise SeedError(f"seed must be an integer from 0 to {MAX_SEED}, got {seed!r}.")
    return int(seed)


def seed_sequence(seed: int, stream: Stream, *keys: int) -> np.random.SeedSequence:
    """Derive a stream from a seed.

    Args:
        seed: Seed of a run or a command.
        stream: Purpose of the stream.
        *keys: Further keys, which distinguish streams of one purpose, see ``Stream``.

    Raises:
        SeedError: If the seed is not an integer from 0 to ``MAX_SEED``.
    """
    return np.random.SeedSequence(check_seed(seed), spawn_key=(int(stream), *keys))


def seed_row(sequence: np.random.SeedSequence) -> NDArray[np.int64]:
    """Convert a stream to an archive's row: seed and keys, padded with -1, int64 ``(4,)``.

    Raises:
        SeedError: If its entropy is not a seed, or it has more than three keys.
    """
    row: NDArray[np.int64] = seed_rows(sequence.entropy, [sequence.spawn_key])[0]
    return row


def seed_rows(seed: Any, keys: Sequence[tuple[int, ...]]) -> NDArray[np.int64]:
    """Convert streams of one seed, all with equally many keys, to rows, int64 ``(R, 4)``.

    Raises:
        SeedError: As in ``seed_row``.
    """
    if len(keys[0]) >= SEED_LENGTH:
        raise SeedError(
            f"An archive keeps a seed and at most {SEED_LENGTH - 1} keys, got {keys[0]}."
        )
    rows = np.full((len(keys), SEED_LENGTH), _FILL, dtype=np.int64)
    rows[:, 0] = check_seed(seed)
    rows[:, 1 : 1 + len(keys[0])] = keys
    return rows


def row_numbers(row: Iterable[int]) -> tuple[int, ...]:
    """Return the seed and keys of a row, without its padding."""
    return tuple(int(number) for number in row if number != _FILL)


def training_generation(row: Iterable[int]) -> int | None:
    """Return the generation whose scenarios a row's stream drew; None for another stream's row."""
    numbers = row_numbers(row)
    is_training = len(numbers) > 2 and numbers[1] == Stream.SCENARIOS
    return numbers[2] if is_training else None


def row_sequence(row: Iterable[int]) -> np.random.SeedSequence:
    """Return the stream of a row: the inverse of ``seed_row``.

    Raises:
        SeedError: If the row identifies no stream.
    """
    numbers = row_numbers(row)
    if not numbers or min(numbers) < 0:
        raise SeedError(f"Expected a seed and keys, none of them negative, got {numbers}.")
    seed, *keys = numbers
    return np.random.SeedSequence(check_seed(seed), spawn_key=keys)
