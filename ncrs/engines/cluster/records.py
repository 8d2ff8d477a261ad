"""What travels between the machines: arrays and plain records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import cloudpickle
import numpy as np
from numpy.typing import NDArray

from ncrs.engines.arguments import GivenBodies, ScenarioRows
from ncrs.engines.base import EngineSettingError, RolloutResult
from ncrs_envs.batched.drawing import draw_recipes
from ncrs_envs.drawing import ScenarioRecipe, SeededScenarios
from ncrs_envs.scenario import Scenario
from ncrs_envs.tasks import BUILT_IN, Task, TaskSettings


@dataclass(frozen=True)
class Setup:
    """What is the same for all shards of an engine."""

    task: tuple[str, int, str, float | None, str, float]
    """Fields of the ``TaskSettings``."""
    definition: bytes | None
    """Pickled task; None for those that come with the package."""
    engine: str
    """Name of the engine that evaluates the shards, or "auto"."""
    threads: int | None
    """Threads of that engine; None for as many as the worker was given."""

    def settings(self) -> TaskSettings:
        """Build the settings of the task, which need not be registered here.

        Raises:
            EngineSettingError: If the task's own functions cannot be imported here.
        """
        if self.definition is None:
            return TaskSettings(*self.task)
        try:
            task: Task = cloudpickle.loads(self.definition)
        except (ImportError, AttributeError) as error:
            raise EngineSettingError(
                f"A worker cannot load the task {self.task[0]!r}: {error}. Install the module of "
                "its functions on the workers, too."
            ) from error
        return _ForeignTaskSettings(*self.task, definition=task)


@dataclass
class _ForeignTaskSettings(TaskSettings):
    """Settings of a task that another process has registered."""

    definition: Task | None = None

    @property
    def task(self) -> Task:
        """Task of these settings."""
        assert self.definition is not None
        return self.definition


def make_setup(settings: TaskSettings, engine: str, threads: int | None) -> Setup:
    """Make the record of a task and of the engine that workers use.

    Raises:
        EngineSettingError: If the functions of a registered task cannot be pickled.
    """
    task, definition = settings.task, None
    if task not in BUILT_IN:
        try:
            # Scenarios are drawn before they travel: workers need no placements.
            definition = cloudpickle.dumps(replace(task, place=None))
        except Exception as error:  # whatever the functions refer to raises
            raise EngineSettingError(
                f"The task {task.name!r} cannot be sent to workers: {error}. Let its functions "
                "refer to nothing but modules and plain values."
            ) from error
    values = (
        settings.name,
        settings.grid_size,
        settings.distance_score,
        settings.success_radius,
        settings.construction,
        settings.hull_density,
    )
    return Setup(values, definition, engine, threads)


TravellingRow = ScenarioRecipe | tuple[Scenario, ...]
"""Scenarios of one evaluation as they travel: their recipe, or the placements themselves."""


def travelling_rows(rows: ScenarioRows) -> list[TravellingRow]:
    """Convert rows of scenarios to records that travel."""
    return [
        row.recipe if isinstance(row, SeededScenarios) and row.recipe is not None else tuple(row)
        for row in rows
    ]


@dataclass(frozen=True)
class Shard:
    """Part of a population, as it is sent to a worker."""

    genomes: NDArray[np.float32]
    """Genomes, ``(k, N)``."""
    rows: Sequence[TravellingRow]
    """Scenarios of all genomes, or of each of the k."""
    setup: Setup
    not_on: str = ""
    """Name of a worker that declines this shard, so that another takes it."""
    bodies: GivenBodies = None

    def scenario_rows(self) -> Sequence[Sequence[Scenario]]:
        """Return the scenarios, drawn again where only their recipe travelled."""
        recipes = [row for row in self.rows if isinstance(row, ScenarioRecipe)]
        if len(recipes) == len(self.rows):
            return draw_recipes(recipes)
        return [row.draw() if isinstance(row, ScenarioRecipe) else row for row in self.rows]


@dataclass(frozen=True)
class WorkerFacts:
    """What a worker says of itself."""

    name: str
    """Name that no other worker has."""
    host: str
    threads: int
    engine: str
    """Name of the engine with which it evaluates."""
    versions: Mapping[str, str]
    """Versions of the packages that determine results, by name."""

    def __str__(self) -> str:
        return self.name if self.host in self.name else f"{self.name} on {self.host}"


@dataclass(frozen=True)
class ShardReply:
    """A worker's answer to a shard."""

    worker: WorkerFacts
    result: RolloutResult | None
    """Results for the k genomes; None if the worker declined."""
    seconds: float
    """Duration of the evaluation on the worker."""


ARRAYS = tuple(item.name for item in fields(RolloutResult))
"""Names of the arrays of a result."""


def joined(results: Sequence[RolloutResult]) -> RolloutResult:
    """Join results of consecutive parts of a population."""
    columns = {name: [getattr(result, name) for result in results] for name in ARRAYS}
    if any(part is None for part in columns["grown"]):
        columns["grown"] = [np.ones(len(result.bodies), dtype=np.bool_) for result in results]
    columns["recovered"] = [
        np.ones(result.success.shape) if part is None else part
        for part, result in zip(columns["recovered"], results, strict=True)
    ]
    return RolloutResult(**{name: np.concatenate(parts) for name, parts in columns.items()})


def rows_of(result: RolloutResult, chosen: slice) -> RolloutResult:
    """Return the results of some genomes."""
    columns = {name: getattr(result, name) for name in ARRAYS}
    return replace(
        result, **{name: part[chosen] for name, part in columns.items() if part is not None}
    )


def differing(first: RolloutResult, second: RolloutResult) -> NDArray[np.intp]:
    """Return the indices of the genomes whose results differ in any bit."""
    unequal = np.zeros(len(first.bodies), dtype=np.bool_)
    for name in ARRAYS:
        one, other = getattr(first, name), getattr(second, name)
        if one is not None and other is not None:
            unequal |= [a.tobytes() != b.tobytes() for a, b in zip(one, other, strict=True)]
    return np.flatnonzero(unequal)
