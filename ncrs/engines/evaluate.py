"""Evaluate genomes: the one call for scripts and notebooks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ncrs.automaton.channels import nca_layout
from ncrs.engines.base import (
    AUTO_ENGINE,
    Evaluation,
    ScenarioRows,
    make_engine,
    resolve_engine,
)
from ncrs_envs.body import DEFAULT_GRID_SIZE
from ncrs_envs.scenario import Scenario, sample_scenarios
from ncrs_envs.tasks import Task, TaskSettings, get_task

EPISODES = 12
"""Episodes per evaluation in the paper."""
# Starting worker processes takes seconds; fewer genomes than this are done before that.
_WORTH_WORKERS = 8


def evaluate(
    genomes: Any,
    task: str | Task,
    *,
    engine: str = AUTO_ENGINE,
    scenarios: Sequence[Scenario] | ScenarioRows | None = None,
    episodes: int = EPISODES,
    seed: int = 0,
    workers: int | None = None,
    grid_size: int = DEFAULT_GRID_SIZE,
    distance_score: str = "exponential",
    success_radius: float | None = None,
) -> Evaluation:
    """Grow each genome's robot and drive it through a set of scenarios.

    Args:
        genomes: finite real numbers, shape ``(P, num_parameters)`` or ``(num_parameters,)``.
        task: "light_chase", "obstacle" or "carry_ball".
        engine: "batched" (numba, fast), "box2d" (the reference), or "auto": batched where numba
            is installed, else box2d.
        scenarios: E scenarios for all genomes, or P rows of E; None draws them from ``seed``.
        episodes: number of scenarios to draw, 12 in the paper; ignored if ``scenarios`` are given.
        seed: of the scenarios that are drawn; ignored likewise.
        workers: processes or threads; None for one per core, or for one process where there is too
            little to do for more. Results do not depend on it.
        grid_size: side n of the body grid.
        distance_score: "exponential" or "inverse_square".
        success_radius: units; None for the task's own.

    Returns:
        Arrays over genomes and episodes, see ``Evaluation``. Bodies that the task cannot use are
        not simulated and get 0.01 per correct part.

    Raises:
        GenomeError: wrong shape, or values that are not finite.
        TaskError, ScenarioError, BodyError: a setting out of range.
        EngineSettingError: unknown engine, or ``workers`` that is no positive integer.
        EngineError: a worker was lost.
    """
    settings = TaskSettings(get_task(task).name, grid_size, distance_score, success_radius)
    checked = nca_layout(settings.task).check_genomes(genomes)
    if scenarios is None:
        scenarios = sample_scenarios(settings.task, seed, episodes, settings.grid_size)
    engine = resolve_engine(engine)
    if workers is None and len(checked) < _WORTH_WORKERS and engine == "box2d":
        workers = 1
    with make_engine(engine, settings, workers) as running:
        return running.evaluate(checked, scenarios)
