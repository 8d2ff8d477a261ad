"""What watches a run while it trains: a progress bar, and a function of the user's."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from ncrs.training.generation import Generation
from ncrs.training.signals import StopRequest

Callback = Callable[[Generation, Mapping[str, float]], object]
"""Function of a generation and its metrics; if it returns True, the run saves and stops."""


class Watch(NamedTuple):
    """Watcher of a run, which never changes its results."""

    progress: bool = True
    """True to show a progress bar."""
    callback: Callback | None = None

    def generation(
        self, generation: Generation, metrics: Mapping[str, float], stop: StopRequest
    ) -> None:
        """Show one generation to the callback, and pass on its wish to stop."""
        if self.callback is None:
            return
        answer = self.callback(generation, metrics)
        if isinstance(answer, bool | np.bool_) and answer:
            stop.ask()


DEFAULT_WATCH = Watch()
"""A progress bar alone."""
