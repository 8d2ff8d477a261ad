"""Seconds of a generation and of its phases."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter


class PhaseTimer:
    """Stopwatch of the training loop."""

    def __init__(self) -> None:
        self._begun = perf_counter()
        self._seconds: dict[str, float] = {}

    def begin(self) -> None:
        """Start a generation."""
        self._begun = perf_counter()

    @property
    def elapsed(self) -> float:
        """Seconds since the generation was started."""
        return perf_counter() - self._begun

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Add the time of the block to that phase."""
        start = perf_counter()
        try:
            yield
        finally:
            self._seconds[name] = self._seconds.get(name, 0.0) + perf_counter() - start

    def take(self) -> dict[str, float]:
        """Return the values of the phases' curves since the last call.

        The time of logging and saving thus belongs to the next generation.
        """
        seconds, self._seconds = self._seconds, {}
        return {f"time/{name}_s": value for name, value in seconds.items()}
