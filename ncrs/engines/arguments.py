"""Checks of an evaluation's scenarios and bodies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.bodies import check_bodies
from ncrs_envs.drawing import DrawnRows
from ncrs_envs.perturbing import are_perturbed, check_can_change
from ncrs_envs.scenario import Scenario, ScenarioError
from ncrs_envs.tasks import TaskSettings

ScenarioRows = Sequence[Sequence[Scenario]]
"""One row of E scenarios for all genomes, or one row per genome."""

GivenBodies = NDArray[np.int8] | None
"""A body for each genome, ``(P, n, n)``, instead of the one it grows; None to grow them."""


def scenario_rows(scenarios: Sequence[Scenario] | ScenarioRows, population: int) -> ScenarioRows:
    """Return one row of scenarios, or one per genome, which may not fit the task.

    Raises:
        ScenarioError: There are no scenarios, or their rows differ in length.
    """
    rows: list[Any] = [scenarios] if _is_row(scenarios) else list(scenarios)
    if not rows or not all(_is_row(row) for row in rows):
        raise ScenarioError(
            "scenarios must be a sequence of ncrs_envs.Scenario, or one such sequence per genome."
        )
    lengths = sorted({len(row) for row in rows})
    if len(lengths) > 1:
        raise ScenarioError(f"Every genome needs equally many scenarios, got {lengths}.")
    return _for_each(rows, population)


def _for_each(rows: ScenarioRows, population: int) -> ScenarioRows:
    if len(rows) not in (1, population):
        raise ScenarioError(
            f"Give scenarios for all genomes, or one row for each of the {population}; "
            f"got {len(rows)} rows."
        )
    return rows


def happens_in(rows: ScenarioRows) -> bool:
    """Return True if anything happens to a robot in any scenario."""
    return not isinstance(rows, DrawnRows) and are_perturbed(rows)


def check_scenario_rows(
    scenarios: Sequence[Scenario] | ScenarioRows, settings: TaskSettings, population: int
) -> ScenarioRows:
    """Return one row of scenarios, or one per genome.

    Raises:
        ScenarioError: There are no scenarios, their rows differ in length, or one does not fit the
            task.
    """
    if isinstance(scenarios, DrawnRows) and scenarios.suit(settings):
        return _for_each(scenarios, population)
    checked = scenario_rows(scenarios, population)
    for row in checked:
        for scenario in row:
            scenario.check(settings.task, settings.grid_size)
            check_can_change(scenario, settings)
    return checked


def check_given_bodies(bodies: Any, settings: TaskSettings, population: int) -> GivenBodies:
    """Return a body for each genome, or None; raise ``BodyError`` if one is not valid."""
    if bodies is None:
        return None
    task, n = settings.task, settings.grid_size
    checked = check_bodies(bodies, task, n, np.ones(population, dtype=np.bool_), "genome")
    return np.array(np.broadcast_to(checked, (population, n, n)))


def _is_row(value: Any) -> bool:
    return (
        isinstance(value, Sequence)
        and len(value) > 0
        and all(isinstance(item, Scenario) for item in value)
    )
