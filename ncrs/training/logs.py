"""What a run reports while it runs: TensorBoard, a table of its curves, and a progress bar."""

from __future__ import annotations

import json
import platform
import sys
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from types import TracebackType

import numpy as np
from numpy.typing import NDArray
from torch.utils.tensorboard import SummaryWriter
from tqdm import tqdm

from ncrs.engines.base import Evaluation
from ncrs.evolution.archive import Archive
from ncrs.runs.champion import Champion
from ncrs.runs.checkpoint import writing
from ncrs.runs.metrics import MetricsFile
from ncrs.runs.settings import TrainConfig
from ncrs.training.tensorboard import RunPictures, add_curves, add_end, add_settings


class VersionWarning(UserWarning):
    """A run goes on with other versions of its libraries than it was saved with."""


_PACKAGES = ("torch", "numpy", "numba", "gymnasium", "cma")
_BAR_SECONDS_WITHOUT_TERMINAL = 15.0


class PhaseTimer:
    """Seconds spent in each phase of a generation."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Count the time of the block to that phase."""
        start = perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + perf_counter() - start

    def take(self) -> dict[str, float]:
        """The seconds so far, which start again at zero."""
        seconds, self.seconds = self.seconds, {}
        return seconds


def versions() -> dict[str, str]:
    """Versions of what decides a run's numbers."""
    import Box2D  # not above: loading it would delay every command

    return {
        "python": platform.python_version(),
        **{name: version(name) for name in _PACKAGES},
        # Its distribution is called box2d or box2d-py, whichever Gymnasium asks for.
        "Box2D": Box2D.__version__,
    }


def warn_of_other_versions(recorded: Mapping[str, str]) -> None:
    """Warn if a run that goes on was saved with other versions of what decides its numbers."""
    other = [
        f"{name} {recorded[name]} (now {own})"
        for name, own in versions().items()
        if recorded.get(name, own) != own
    ]
    if other:
        warnings.warn(
            f"This run was last saved with {', '.join(other)}: it goes on, but not necessarily as "
            "it would have there.",
            VersionWarning,
            stacklevel=2,
        )


def generation_metrics(evaluation: Evaluation) -> dict[str, float]:
    """Curves that one generation's evaluation gives; NaN fitness is counted, not averaged."""
    fitness = evaluation.fitness[np.isfinite(evaluation.fitness)]
    best = int(np.nanargmax(evaluation.fitness))
    return {
        "fitness/best": float(fitness.max()),
        "fitness/mean": float(fitness.mean()),
        "fitness/median": float(np.median(fitness)),
        "fitness/std": float(fitness.std()),
        "fitness/nan": float(len(evaluation.fitness) - len(fitness)),
        "success/best": float(evaluation.success[best].mean()),
        "success/mean": float(evaluation.success.mean()),
        "bodies/valid": float(evaluation.valid.mean()),
        "bodies/cells_of_best": float(max(evaluation.measures[best, 2], 0)),
    }


class RunLog:
    """TensorBoard, table and progress bar of one run; a context manager.

    Args:
        run_dir: folder of the event files.
        config: written as text with the versions, and as hyperparameters.
        start: first generation; what was recorded from there on is dropped.
    """

    def __init__(self, run_dir: Path, config: TrainConfig, start: int) -> None:
        self._run_dir = run_dir
        with writing(run_dir):
            self._writer = SummaryWriter(str(run_dir), purge_step=start if start else None)
        self._pictures = RunPictures(self._writer)
        self._table = MetricsFile(run_dir, start)
        self._of_champion: dict[str, float] = {}
        self._last = config.generations - 1
        if start == 0:
            self._text("config", asdict(config))
            self._text("versions", versions())
            add_settings(self._writer, config)
        terminal = sys.stderr.isatty()
        self._bar = tqdm(
            total=config.generations,
            initial=start,
            unit="gen",
            desc=config.task.name,
            mininterval=0.1 if terminal else _BAR_SECONDS_WITHOUT_TERMINAL,
            dynamic_ncols=terminal,
        )

    def _text(self, tag: str, value: Mapping[str, object]) -> None:
        block = "\n".join("    " + line for line in json.dumps(value, indent=2).splitlines())
        self._writer.add_text(tag, block, 0)

    def generation(self, index: int, metrics: Mapping[str, float], best: float) -> None:
        """Record one generation.

        Args:
            index: its number, from 0.
            metrics: value of each curve.
            best: best training fitness so far, for the bar.
        """
        values = {**metrics, **self._of_champion}
        self._of_champion = {}
        with writing(self._run_dir):
            add_curves(self._writer, values, index)
            self._table.add(index, values)
        self._bar.set_postfix(best=f"{best:.4f}", refresh=False)
        self._bar.update()

    def champion(self, champion: Champion) -> None:
        """Record the champion with the next generation."""
        self._of_champion = {
            "champion/fitness": champion.fitness,
            "champion/success": champion.success,
        }
        with writing(self._run_dir):
            self._pictures.champion(champion)

    def population(
        self,
        index: int,
        fitness: NDArray[np.float64],
        genomes: NDArray[np.floating],
        archive: Archive,
    ) -> None:
        """Draw histograms and pictures of a generation, where there is time for them.

        Args:
            index: its number.
            fitness: ``(P,)``.
            genomes: ``(P, N)``.
            archive: after this generation.
        """
        last = index == self._last
        with writing(self._run_dir):
            self._pictures.generation(index, fitness, genomes, archive, last=last)
            if last:
                add_end(self._writer)

    def __enter__(self) -> RunLog:
        return self

    def __exit__(
        self,
        exception_type: type[BaseException] | None,
        exception: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._bar.close()
        with writing(self._run_dir):
            self._writer.close()
