"""Stopping at a signal: the first requests it, the second forces it."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Any

OF_SCHEDULERS = ("SIGUSR1", "SIGUSR2")
"""Signals by which a scheduler announces that a job's time ends, where something handles them."""


def _signals() -> list[signal.Signals]:
    """List the signals that request a stop.

    Those are SIGINT, and SIGTERM and SIGHUP unless something handles or ignores them, as nohup
    does. A scheduler's library, such as submitit, queues the job again at another signal, which is
    passed on to it once the run is saved.
    """
    numbers = [signal.SIGINT]
    ends = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    numbers += [number for number in ends if signal.getsignal(number) == signal.SIG_DFL]
    named = [getattr(signal, name) for name in OF_SCHEDULERS if hasattr(signal, name)]
    return numbers + [number for number in named if callable(signal.getsignal(number))]


class StopRequest:
    """Context that only remembers the first signal, in ``received``.

    A second signal acts as it would without the context. Outside the main thread, where Python
    handles no signals, nothing changes.
    """

    def __init__(self) -> None:
        self.received: signal.Signals | None = None
        self._is_asked = False
        self._previous: dict[signal.Signals, Any] = {}

    def __call__(self) -> bool:
        """Return True once a signal has been received, or somebody asked to stop."""
        return self.received is not None or self._is_asked

    def ask(self) -> None:
        """Request the stop without a signal."""
        self._is_asked = True

    def __enter__(self) -> StopRequest:
        if threading.current_thread() is threading.main_thread():
            self._previous = {number: signal.signal(number, self._handle) for number in _signals()}
        return self

    def __exit__(
        self,
        exception_type: type[BaseException] | None,
        exception: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._restore()

    def _restore(self) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)
        self._previous = {}

    def _handle(self, number: int, frame: FrameType | None) -> None:
        self.received = signal.Signals(number)
        self._restore()
