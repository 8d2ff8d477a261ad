"""The fitness of a robot that never moves: the line that an elite has to beat."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ncrs.engines.arguments import ScenarioRows
from ncrs_envs.batched.dtypes import column
from ncrs_envs.drawing import DrawnRows
from ncrs_envs.scenario import Point, Scenario
from ncrs_envs.tasks import TaskSettings, distance_scores, playfield


def standing_still_fitness(
    settings: TaskSettings, scenarios: Sequence[Scenario] | ScenarioRows
) -> NDArray[np.float64]:
    """Compute the fitness of standing still, exactly: nothing moves, all steps earn the same.

    Args:
        settings: Task with its settings.
        scenarios: E scenarios, or rows of E.

    Returns:
        Mean over the scenarios, float64, shape ``()``; or one value per row.
    """
    if isinstance(scenarios, DrawnRows):
        places = _recorded(scenarios)
    elif isinstance(scenarios[0], Scenario):
        places = np.array([_places(item) for item in scenarios if isinstance(item, Scenario)])
    else:
        places = np.array([[_places(item) for item in row] for row in scenarios])  # type: ignore[union-attr]
    distances = np.hypot(*np.moveaxis(np.diff(places, axis=-2), -1, 0))
    if not settings.task.has_ball:
        distances = distances[..., :1]
    extent, kind = playfield(settings.grid_size), settings.distance_score
    return np.asarray(distance_scores(distances, extent, kind).mean(axis=(-2, -1)))


def _places(scenario: Scenario) -> list[Point]:
    """Return where the robot starts, the light or the ball, and the target or nothing."""
    goal = scenario.ball if scenario.light is None else scenario.light
    assert goal is not None  # a scenario has one or the other
    return [scenario.start, goal, goal if scenario.target is None else scenario.target]


def _recorded(rows: DrawnRows) -> NDArray[np.float64]:
    """Return the same of records, ``(R, E, 3, 2)``."""
    columns = ((f"{name}_x", f"{name}_y") for name in ("start", "goal", "target"))
    records = rows.records.scenarios
    places = [[column(records, x), column(records, y)] for x, y in columns]
    return np.ascontiguousarray(np.moveaxis(np.array(places), (0, 1), (2, 3)))
