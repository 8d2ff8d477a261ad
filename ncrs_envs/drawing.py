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
"""Spawn keys of seeds."""


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
        scenarios: Scenarios as they were drawn; None to draw them when they are first needed.
        recipe: Record that draws the same ones; None if that needs functions that are not part of
            the package.
    """

    def __init__(self, scenarios: Sequence[Scenario] | None, recipe: ScenarioRecipe | None) -> None:
        self._drawn = None if scenarios is None else tuple(scenarios)
        self.recipe = recipe

    @property
    def _scenarios(self) -> tuple[Scenario, ...]:
        if self._drawn is None:
            assert self.recipe is not None
            self._drawn = tuple(self.recipe.draw())
        return self._drawn

    @overload
    def __getitem__(self, index: int) -> Scenario: ...

    @overload
    def __getitem__(self, index: slice) -> Sequence[Scenario]: ...

    def __getitem__(self, index: int | slice) -> Scenario | Sequence[Scenario]:
        return self._scenarios[index]

    def __len__(self) -> int:
        return len(self._scenarios) if self.recipe is None else self.recipe.episodes


class DrawnRows(Sequence[SeededScenarios]):
    """Rows of scenarios that nothing happens in, as records; a row's objects are made on demand.

    Args:
        recipe: Recipe of a row, but for its spawn key.
        keys: Spawn key of each of the R rows.
        records: The E scenarios of each row for the compiled simulators, ``(R, E)``.
    """

    def __init__(self, recipe: ScenarioRecipe, keys: Keys, records: Scenarios) -> None:
        self._recipe, self._keys = recipe, keys
        self.records = records

    @overload
    def __getitem__(self, index: int) -> SeededScenarios: ...

    @overload
    def __getitem__(self, index: slice) -> Sequence[SeededScenarios]: ...

    def __getitem__(self, index: int | slice) -> SeededScenarios | Sequence[SeededScenarios]:
        if isinstance(index, slice):
            return [self[row] for row in range(len(self))[index]]
        return SeededScenarios(None, replace(self._recipe, spawn_key=tuple(self._keys[index])))

    def __len__(self) -> int:
        return len(self._keys)

    def suit(self, settings: TaskSettings) -> bool:
        """Return True if they were drawn for such a task and grid, so that they fit it."""
        return (self._recipe.task, self._recipe.grid_size) == (settings.name, settings.grid_size)


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
