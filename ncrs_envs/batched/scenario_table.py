"""The scenarios of many runs: as records for the kernels, and as objects when somebody asks."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.layout import (
    SCENARIO_SEEN_X,
    SCENARIO_SEEN_Y,
    SCENARIO_START_X,
    SCENARIO_START_Y,
    scenario_size,
)
from ncrs_envs.batched.records import quad_capacity, scenario_arrays
from ncrs_envs.batched.sampling import MAX_QUADS, ObstacleDraws
from ncrs_envs.scenario import Scenario, sample_scenario
from ncrs_envs.tasks import Task

Indices = NDArray[np.intp]


class ScenarioTable:
    """Scenarios of ``count`` runs of one task, at first none.

    Attributes:
        records: float64 ``(count, scenario_size(quads))``, with room for as many wall quads as any
            scenario so far has had.
    """

    def __init__(self, task: Task, count: int, grid_size: int) -> None:
        self._task = task
        self._grid_size = grid_size
        self.records = np.zeros((count, scenario_size(MAX_QUADS if task.has_walls else 0)))
        self._makers: list[Callable[[], Scenario] | None] = [None] * count

    def __getitem__(self, run: int) -> Scenario | None:
        """The scenario of a run, or None."""
        make = self._makers[run]
        return None if make is None else make()

    def start(self, run: int) -> tuple[float, float]:
        """Where a run's robot starts."""
        row = self.records[run]
        return float(row[SCENARIO_START_X]), float(row[SCENARIO_START_Y])

    def put(self, runs: Sequence[int], scenarios: Sequence[Scenario]) -> None:
        """Give runs these scenarios, already checked."""
        if not scenarios:
            return
        rows = scenario_arrays(scenarios, self._grid_size, quad_capacity(scenarios))
        width, needed = self.records.shape[1], rows.shape[1]
        if needed > width:
            self.records = np.pad(self.records, ((0, 0), (0, needed - width)))
        self.records[runs, :needed] = rows
        for run, scenario in zip(runs, scenarios, strict=True):
            self._makers[run] = _Kept(scenario)

    def draw(
        self,
        runs: Sequence[int],
        generators: Sequence[np.random.Generator],
        regions: Sequence[int | None],
    ) -> None:
        """Give runs the scenarios that ``sample_scenario`` draws from these generators."""
        if not self._task.has_walls:
            self.put(
                runs,
                [
                    sample_scenario(self._task, generator, region, self._grid_size)
                    for generator, region in zip(generators, regions, strict=True)
                ],
            )
        elif runs:
            rows = np.empty((len(runs), scenario_size(MAX_QUADS)))
            draws = ObstacleDraws(generators, regions, self._grid_size, rows)
            self.records[runs, : rows.shape[1]] = rows
            for i, run in enumerate(runs):
                self._makers[run] = _Drawn(draws, i)


class _Kept:
    """A scenario that is already there."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario

    def __call__(self) -> Scenario:
        return self._scenario


class _Drawn:
    """A scenario that is still only numbers."""

    def __init__(self, draws: ObstacleDraws, index: int) -> None:
        self._draws = draws
        self._index = index

    def __call__(self) -> Scenario:
        row = self._draws.records[self._index]
        return Scenario(
            start=(row[SCENARIO_START_X], row[SCENARIO_START_Y]),
            light=(row[SCENARIO_SEEN_X], row[SCENARIO_SEEN_Y]),
            walls=self._draws.walls(self._index),
        )
