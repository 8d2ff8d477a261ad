"""Results of runs and sweeps: a row for each run, and aggregates over seeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ncrs.runs.assessment import Assessment, find_assessment
from ncrs.runs.champion import CHAMPION_FILE, find_champion
from ncrs.runs.checkpoint import CHECKPOINT_FOLDER, generations_done, write_atomically, write_json
from ncrs.runs.failure import FAILURE_FILE, failure_of
from ncrs.runs.folders import (
    SEED,
    Run,
    differing_settings,
    find_folders,
    group_runs,
    setting_text,
)
from ncrs.runs.settings import SETTINGS_FILE, load_config
from ncrs.runs.statistics import bootstrap_interval, interquartile_mean
from ncrs.runs.tables import csv_table, markdown_table, text_table

RESULTS_STEM = "results"
"""Name of the files in a sweep's folder, without suffix."""
_NONE = "-"


@dataclass(frozen=True)
class RunResult:
    """Result of one run, as far as it has come."""

    name: str
    """Path of the run, below the folder that was given."""
    run: Run | None
    """The run; None if its settings were refused."""
    generations: int
    """Number of generations done."""
    failure: str | None
    """Message of the error that ended it; None without one."""
    champion_fitness: float | None
    """Fitness on the scenarios by which champions were compared in training."""
    assessment: Assessment | None
    """Test of the champion on fresh episodes; None without one."""

    @property
    def is_finished(self) -> bool:
        """True if all generations are done and the job has not failed."""
        if self.failure is not None or self.run is None:
            return False
        return self.generations >= self.run.config.generations

    @property
    def is_scored(self) -> bool:
        """True if the run has finished and its champion was tested, or it found none."""
        return self.is_finished and (self.champion_fitness is None or self.assessment is not None)

    @property
    def scores(self) -> tuple[float, float]:
        """Fitness and fraction of success on fresh episodes; 0 for a run without a champion."""
        if self.assessment is None:
            return 0.0, 0.0
        return self.assessment.fitness, self.assessment.success.fraction

    @property
    def status(self) -> str:
        """State of the run in a few words."""
        if self.failure is not None:
            return "failed"
        if self.run is None or self.is_finished:
            return "finished"
        return f"unfinished ({self.generations} of {self.run.config.generations} generations)"


@dataclass(frozen=True)
class Aggregate:
    """Statistics of one quantity over the seeds of a group."""

    median: float
    interquartile_mean: float
    interval: tuple[float, float]
    """95 % bootstrap interval of the interquartile mean."""

    @classmethod
    def of(cls, values: Sequence[float]) -> Aggregate:
        """Compute the statistics of at least one value."""
        array = np.asarray(values, dtype=np.float64)
        mean = float(interquartile_mean(array))
        return cls(float(np.median(array)), mean, bootstrap_interval(values))


@dataclass(frozen=True)
class GroupResult:
    """Aggregates over the finished and tested runs of a group; no champion counts as 0."""

    settings: Mapping[str, Any]
    seeds: int
    fitness: Aggregate
    success: Aggregate


@dataclass(frozen=True)
class Results:
    """Results of several runs."""

    rows: Sequence[RunResult]
    differing: Sequence[str]
    """Dotted names of the settings that differ among the runs."""
    groups: Sequence[GroupResult]

    @property
    def complete(self) -> bool:
        """True if every run has finished."""
        return all(row.is_finished for row in self.rows)

    def lines(self) -> list[str]:
        """Format both tables and the failures as text."""
        lines = text_table(*self._runs())
        if self.groups:
            lines += ["", "Over seeds, with 95 % bootstrap intervals (IQM: interquartile mean):"]
            lines += text_table(*self._aggregates())
        return lines + self._troubles()

    def markdown(self) -> list[str]:
        """Format both tables and the failures as Markdown."""
        lines = markdown_table(*self._runs())
        if self.groups:
            lines += [
                "",
                "Over seeds, with 95 % bootstrap intervals (IQM: interquartile mean):",
                "",
            ]
            lines += markdown_table(*self._aggregates())
        return lines + self._troubles()

    def _troubles(self) -> list[str]:
        failed = [f"{row.name}: {row.failure}" for row in self.rows if row.failure is not None]
        return ["", "Failed:", *failed] if failed else []

    def _runs(self) -> tuple[list[str], list[list[str]]]:
        columns = ["run", *map(_short, self.differing), "status", "fitness", "success"]
        return columns, [
            [row.name, *_setting_cells(row, self.differing), row.status, *_result_cells(row)]
            for row in self.rows
        ]

    def _aggregates(self) -> tuple[list[str], list[list[str]]]:
        names = [name for name in self.differing if name != SEED]
        columns = [*map(_short, names), "seeds", "fitness: median", "IQM", "success: median", "IQM"]
        return columns, [
            [
                *(_cell(group.settings.get(name)) for name in names),
                str(group.seeds),
                f"{group.fitness.median:.3f}",
                _interval(group.fitness.interquartile_mean, group.fitness.interval, ".3f"),
                f"{group.success.median:.0%}",
                _interval(group.success.interquartile_mean, group.success.interval, ".0%"),
            ]
            for group in self.groups
        ]

    def csv(self) -> str:
        """Format the runs as CSV, with unrounded values."""
        columns = [
            "run", *self.differing, "status", "generations", "champion_fitness", "episodes",
            "fitness", "fitness_low", "fitness_high", "success", "success_low", "success_high",
            "error",
        ]  # fmt: skip
        rows = []
        for row in self.rows:
            test: list[object] = [None] * 7
            if row.assessment is not None:
                success = row.assessment.success
                test = [success.episodes, row.assessment.fitness]
                test += [*row.assessment.fitness_interval(), success.fraction, *success.interval]
            cells = _setting_cells(row, self.differing)
            rows.append(
                [row.name, *cells, row.status, row.generations, row.champion_fitness, *test]
                + [row.failure]
            )
        return csv_table(columns, rows)

    def as_json(self) -> dict[str, Any]:
        """Return rows and aggregates as JSON values."""
        return {
            "runs": [
                {
                    "run": row.name,
                    "settings": {} if row.run is None else row.run.settings(),
                    "status": row.status,
                    "generations": row.generations,
                    "champion_fitness": row.champion_fitness,
                    "test": None if row.assessment is None else row.assessment.as_json(),
                    "error": row.failure,
                }
                for row in self.rows
            ],
            "groups": [asdict(group) for group in self.groups],
        }


def _short(name: str) -> str:
    """Return a setting's name as it is chosen on the command line, without ".name"."""
    return name.removesuffix(".name")


def _cell(value: Any) -> str:
    return _NONE if value is None else setting_text(value)


def _setting_cells(row: RunResult, names: Sequence[str]) -> list[str]:
    settings = {} if row.run is None else row.run.settings()
    return [_cell(settings.get(name)) for name in names]


def _result_cells(row: RunResult) -> list[str]:
    test = row.assessment
    if test is None:
        return [_NONE, _NONE]
    fraction, low, high = test.success.percentages()
    fitness = _interval(test.fitness, test.fitness_interval(), ".3f")
    return [fitness, f"{fraction} ({low} to {high})"]


def _interval(value: float, interval: tuple[float, float], style: str) -> str:
    low, high = interval
    return f"{value:{style}} ({low:{style}} to {high:{style}})"


def collect_results(paths: Sequence[Path]) -> Results:
    """Collect the results of runs.

    Args:
        paths: Folders of runs, or of sweeps.

    Raises:
        ConfigError: If a path is not a folder or holds no run, or a run's settings are damaged.
        CheckpointError: If a champion or the result of a test is damaged.
    """
    found: dict[Path, Path] = {}  # each folder once, with the path that it was given in
    for path in paths:
        for folder in find_folders([path], (SETTINGS_FILE, FAILURE_FILE)):
            if folder.resolve() not in {other.resolve() for other in found}:
                found[folder] = path
    rows = [_result(folder, path) for folder, path in found.items()]
    runs = [row.run for row in rows if row.run is not None]
    scores = {row.run.folder: row.scores for row in rows if row.run is not None and row.is_scored}
    groups = []
    for group in group_runs(runs):
        scored = [scores[run.folder] for run in group.runs if run.folder in scores]
        if scored:
            fitness, success = zip(*scored, strict=True)
            settings = group.runs[0].settings()
            aggregates = Aggregate.of(fitness), Aggregate.of(success)
            groups.append(GroupResult(settings, len(scored), *aggregates))
    return Results(rows, differing_settings([run.settings() for run in runs]), groups)


def _result(folder: Path, given: Path) -> RunResult:
    run = None
    if (folder / SETTINGS_FILE).is_file():
        run = Run(folder, load_config(folder))
    champion = find_champion(folder) if (folder / CHAMPION_FILE).is_file() else None
    return RunResult(
        name=folder.name if folder == given else folder.relative_to(given).as_posix(),
        run=run,
        generations=generations_done(folder / CHECKPOINT_FOLDER),
        failure=failure_of(folder),
        champion_fitness=None if champion is None else champion.fitness,
        assessment=find_assessment(folder, champion),
    )


def save_results(results: Results, folder: Path) -> list[Path]:
    """Write results as CSV, JSON and Markdown, and return the files' paths.

    Raises:
        CheckpointError: If a file cannot be written.
    """
    texts = {"csv": results.csv(), "md": "\n".join(results.markdown()) + "\n"}
    paths = []
    for suffix, text in texts.items():
        paths.append(folder / f"{RESULTS_STEM}.{suffix}")
        data = text.encode()
        write_atomically(paths[-1], lambda stream, data=data: stream.write(data))  # type: ignore[misc]
    paths.append(folder / f"{RESULTS_STEM}.json")
    write_json(paths[-1], results.as_json())
    return paths
