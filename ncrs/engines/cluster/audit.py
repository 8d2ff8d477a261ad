"""Genomes that a second worker evaluates, so that a worker that computes other numbers is found."""

from __future__ import annotations

import math
import warnings

import numpy as np

from ncrs.engines.base import EngineSettingError, RolloutResult
from ncrs.engines.cluster.records import WorkerFacts, differing, rows_of
from ncrs.engines.cluster.work import Piece
from ncrs.engines.pool import WorkerWarning


class Audit:
    """Choice of the genomes, and comparison of their results.

    Args:
        share: Share of each population, 0 to 1; one genome at least, unless it is 0.

    Raises:
        EngineSettingError: If the share is out of range.
    """

    def __init__(self, share: float) -> None:
        if not 0.0 <= share <= 1.0:
            raise EngineSettingError(f"engine.audit must be from 0 to 1, got {share!r}.")
        self._share = share
        self._rng = np.random.default_rng(0)  # results do not depend on what is chosen
        self._first = self._last = 0
        self._named: set[frozenset[str]] = set()
        self.checked = 0
        """Number of genomes that a second worker has evaluated."""
        self.differences = 0
        """Number of them with other results there."""

    def begin(self, population: int) -> None:
        """Choose consecutive genomes of a new population."""
        count = math.ceil(self._share * population)
        self._first = int(self._rng.integers(population - count + 1))
        self._last = self._first + count

    def checks(self, piece: Piece) -> list[Piece]:
        """Return the part of an evaluated piece that is to be checked, if there is any."""
        first, last = max(piece.first, self._first), min(piece.last, self._last)
        return [Piece(first, last, check_of=piece)] if first < last else []

    def compare(self, check: Piece, result: RolloutResult, worker: WorkerFacts) -> None:
        """Compare the result of a check with the original one.

        Warns:
            WorkerWarning: They differ; said once for each two workers.
        """
        original = check.check_of
        assert original is not None
        assert original.result is not None
        assert original.worker is not None
        first = check.first - original.first
        expected = rows_of(original.result, slice(first, first + len(check)))
        self.checked += len(check)
        unequal = differing(expected, result)
        self.differences += len(unequal)
        pair = frozenset((original.worker.name, worker.name))
        if not len(unequal) or pair in self._named:
            return
        self._named.add(pair)
        index = int(unequal[0])
        one, other = (float(each.episode_fitness[index].mean()) for each in (expected, result))
        warnings.warn(
            f"Genome {check.first + index} got fitness {one!r} from the worker {original.worker}, "
            f"{other!r} from {worker}: one of them is broken, or their processors round "
            "differently.",
            WorkerWarning,
            stacklevel=2,
        )
