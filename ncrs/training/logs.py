"""The log of a run: TensorBoard, a table of its curves, and a progress bar."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from types import TracebackType

from tqdm import tqdm

from ncrs.evolution.archive import Archive
from ncrs.runs.champion import Champion
from ncrs.runs.checkpoint import sync_files, writing
from ncrs.runs.metrics import METRICS_FILE, MetricsFile
from ncrs.runs.settings import TrainConfig
from ncrs.training.events import RunWriter, event_files, keep_events
from ncrs.training.generation import Generation
from ncrs.training.tensorboard import RunPictures, add_curves, add_end, add_settings
from ncrs.training.versions import versions

_BAR_SECONDS_WITHOUT_TERMINAL = 15.0


class RunLog:
    """TensorBoard, table and progress bar of one run; a context manager.

    Args:
        run_dir: Folder of the run.
        config: Settings of the run, written as text with the versions, and as hyperparameters.
        start: Index of the first generation to come; records from there on are dropped.
        progress: Show the progress bar.
    """

    def __init__(
        self, run_dir: Path, config: TrainConfig, start: int, progress: bool = True
    ) -> None:
        self._run_dir = run_dir
        with writing(run_dir):
            keep_events(run_dir, start)
            self._writer = RunWriter(run_dir)
            if start == 0:
                self._text("config", asdict(config))
                self._text("versions", versions())
                add_settings(self._writer, config)
        self._pictures = RunPictures(self._writer)
        self._table = MetricsFile(run_dir, start)
        self._of_champion: dict[str, float] = {}
        self._last = config.generations - 1
        terminal = sys.stderr.isatty()
        self._bar = tqdm(
            total=config.generations,
            initial=start,
            unit="gen",
            disable=not progress,
            desc=config.task.name,
            mininterval=0.1 if terminal else _BAR_SECONDS_WITHOUT_TERMINAL,
            dynamic_ncols=terminal,
        )

    def _text(self, tag: str, value: Mapping[str, object]) -> None:
        block = "\n".join("    " + line for line in json.dumps(value, indent=2).splitlines())
        self._writer.add_text(tag, block, 0)

    def generation(
        self, generation: Generation, metrics: Mapping[str, float], archive: Archive
    ) -> None:
        """Record one generation, with pictures and histograms where there is time for them.

        Args:
            generation: Genomes and results of the generation.
            metrics: Value of each curve.
            archive: Archive after this generation.
        """
        index, fitness = generation.index, generation.evaluation.fitness
        values = {**metrics, **self._of_champion}
        self._of_champion = {}
        last = index == self._last
        with writing(self._run_dir):
            add_curves(self._writer, values, index)
            self._table.add(index, values)
            self._pictures.generation(index, fitness, generation.genomes, archive, last=last)
            if last:
                add_end(self._writer)
        self._bar.set_postfix(best=f"{metrics['fitness/best_so_far']:.4f}", refresh=False)
        self._bar.update()

    def champion(self, champion: Champion) -> None:
        """Record the champion with the next generation."""
        self._of_champion = {
            "champion/fitness": champion.fitness,
            "champion/success": champion.success,
        }
        self._pictures.champion(champion)

    def sync(self) -> None:
        """Put all records on the disk: after a power cut a checkpoint must not be ahead of them.

        Raises:
            CheckpointError: If the disk is full or broken.
        """
        with writing(self._run_dir):
            self._writer.flush()
        files = event_files(self._run_dir)
        sync_files(self._run_dir, [*files, self._run_dir / METRICS_FILE])

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
