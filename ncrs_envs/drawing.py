"""Scenarios that were drawn from a seed, with the record that draws them again elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, overload

import numpy as np

from ncrs_envs.curriculum import OWN_CURRICULA
from ncrs_envs.mirroring import STANDARD, ScenarioSampling
from ncrs_envs.scenario import Scenario
from ncrs_envs.tasks import BUILT_IN, TaskSettings

if TYPE_CHECKING:
    from ncrs_envs.batched.layout import Scenarios

Keys = Sequence[tuple[int, ...]]
"""Spawn keys of seeds, all of the same length."""


@dataclass(frozen=True)
class ScenarioRecipe:
    """Seed and settings that the scenarios of one evaluation follow from, in any process."""

    task: str
    """Name of one of the tasks that come with the package."""
    grid_size: int
    episodes: int
    sampling: ScenarioSampling
    entropy: int
    spawn_key: tuple[int, ...]
    generation: int | None
    """Generation of the curriculum; None for scenarios as they are drawn."""

    def draw(self) -> list[Scenario]:
        """Draw the scenarios; the last few recipes are remembered."""
        return list(_drawn(self))


@lru_cache(maxsize=256)
def _drawn(recipe: ScenarioRecipe) -> tuple[Scenario, ...]:
    seed = np.random.SeedSequence(recipe.entropy, spawn_key=recipe.spawn_key)
    scenarios = recipe.sampling.draw(
        recipe.task, seed, recipe.episodes, recipe.grid_size, recipe.generation
    )
    return tuple(scenarios)


class SeededScenarios(Sequence[Scenario]):
    """Scenarios of one evaluation, with their recipe.

    Args:
        scenarios: Scenarios as they were drawn.
        recipe: Record that draws the same ones; None if that needs functions that are not part of
            the package.
    """

    def __init__(self, scenarios: Sequence[Scenario], recipe: ScenarioRecipe | None) -> None:
        self._scenarios = tuple(scenarios)
        self.recipe = recipe

    @overload
    def __getitem__(self, index: int) -> Scenario: ...

    @overload
    def __getitem__(self, index: slice) -> Sequence[Scenario]: ...

    def __getitem__(self, index: int | slice) -> Scenario | Sequence[Scenario]:
        return self._scenarios[index]

    def __len__(self) -> int:
        return len(self._scenarios)


class DrawnRows(Sequence[Sequence[Scenario]]):
    """Rows of scenarios that nothing happens in, as records; a row's objects are made on demand.

    Args:
        sampling: Settings that they were drawn with.
        settings: Task and its settings that they were drawn for.
        seed: Entropy of all rows.
        keys: Spawn key of each of the R rows.
        records: The E scenarios of each row for the compiled simulators, ``(R, E)``.
        generation: As in ``ScenarioSampling.draw``.
    """

    def __init__(  # noqa: PLR0913 - what the rows follow from, and the rows
        self,
        sampling: ScenarioSampling,
        settings: TaskSettings,
        seed: int,
        keys: Keys,
        records: Scenarios,
        generation: int | None,
    ) -> None:
        self._sampling, self._settings = sampling, replace(settings)
        self._seed, self._keys, self._generation = seed, keys, generation
        self.records = records

    @overload
    def __getitem__(self, index: int) -> Sequence[Scenario]: ...

    @overload
    def __getitem__(self, index: slice) -> Sequence[Sequence[Scenario]]: ...

    def __getitem__(self, index: int | slice) -> Sequence[Scenario] | Sequence[Sequence[Scenario]]:
        if isinstance(index, slice):
            return [self[row] for row in range(len(self))[index]]
        seed = np.random.SeedSequence(self._seed, spawn_key=self._keys[index])
        episodes = self.records.scenarios.shape[1]
        return draw_scenarios(self._sampling, self._settings, seed, episodes, self._generation)

    def __len__(self) -> int:
        return len(self._keys)

    def suit(self, settings: TaskSettings) -> bool:
        """Return True if they were drawn for a task with these settings, so that they fit it."""
        return self._settings == settings


def draw_scenarios(
    sampling: ScenarioSampling,
    settings: TaskSettings,
    seed: np.random.SeedSequence,
    episodes: int,
    generation: int | None = None,
) -> SeededScenarios:
    """Draw the scenarios of one evaluation, as ``ScenarioSampling.draw`` does.

    Raises:
        ScenarioError: ``episodes`` is not a positive integer, or the sampling is out of range.
    """
    task = settings.task
    scenarios = sampling.draw(task, seed, episodes, settings.grid_size, generation)
    recipe = None
    is_own = sampling.kind == STANDARD and sampling.curriculum in OWN_CURRICULA
    if task in BUILT_IN and is_own and isinstance(seed.entropy, int):
        recipe = ScenarioRecipe(
            task=task.name,
            grid_size=settings.grid_size,
            episodes=episodes,
            sampling=sampling,
            entropy=seed.entropy,
            spawn_key=tuple(seed.spawn_key),
            generation=generation,
        )
    return SeededScenarios(scenarios, recipe)
