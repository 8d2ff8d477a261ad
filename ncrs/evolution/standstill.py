"""The fitness of a robot that never moves: the line that an elite has to beat."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ncrs.engines.arguments import ScenarioRows
from ncrs_envs.scenario import Scenario
from ncrs_envs.tasks import TaskSettings, distance_score, playfield


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
    values = [
        _reward(settings, item)
        if isinstance(item, Scenario)
        else float(standing_still_fitness(settings, item))
        for item in scenarios
    ]
    if isinstance(scenarios[0], Scenario):
        return np.asarray(np.mean(values))
    return np.asarray(values)


def _reward(settings: TaskSettings, scenario: Scenario) -> float:
    start, light, ball, target = scenario.start, scenario.light, scenario.ball, scenario.target
    if ball is not None and target is not None:
        distances = [math.dist(start, ball), math.dist(ball, target)]
    else:
        assert light is not None  # a scenario has one or the other
        distances = [math.dist(start, light)]
    extent = playfield(settings.grid_size)
    return float(np.mean([distance_score(d, extent, settings.distance_score) for d in distances]))
