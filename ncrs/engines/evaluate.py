"""Evaluation of genomes in one call, for scripts and notebooks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ncrs.automaton.channels import nca_layout
from ncrs.engines.arguments import ScenarioRows, scenario_rows
from ncrs.engines.base import AUTO_ENGINE, Evaluation, make_engine, resolve_engine
from ncrs_envs.body import DEFAULT_GRID_SIZE, HULL_DENSITY
from ncrs_envs.mirroring import ScenarioSampling
from ncrs_envs.perturbing import NO_PERTURBATIONS, PerturbationSettings, are_perturbed
from ncrs_envs.scenario import Scenario, ScenarioError
from ncrs_envs.tasks import RIGID, Task, TaskSettings, get_task

EPISODES = 12
"""Number of episodes per evaluation in the paper."""
# Starting worker processes takes seconds; fewer genomes than this are evaluated sooner without.
_WORTH_WORKERS = 8


def evaluate(  # noqa: PLR0913 - the public call, keywords only
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
    construction: str = RIGID,
    hull_density: float = HULL_DENSITY,
    bodies: Any = None,
    perturbations: PerturbationSettings = NO_PERTURBATIONS,
) -> Evaluation:
    """Grow each genome's robot and drive it through a set of scenarios.

    Args:
        genomes: Finite real numbers, shape ``(P, num_parameters)`` or ``(num_parameters,)``.
        task: Task or its name, "light_chase", "obstacle" or "carry_ball".
        engine: Engine to use: "batched" (compiled, fast), "box2d" (the reference), "dask" or
            "futures" (workers of a cluster), or "auto" for the best engine that works here:
            batched, unless the task or a setting needs Box2D.
        scenarios: One row of E scenarios for all genomes, or P rows of E; None to sample them.
        episodes: Number of scenarios to sample, 12 in the paper; ignored if ``scenarios`` is given.
        seed: Seed for sampling the scenarios; ignored if ``scenarios`` is given.
        workers: Number of processes or threads; None for one per core, or for a single process if
            there are few genomes. Results do not depend on it.
        grid_size: Side n of the body grid.
        distance_score: Distance score, "exponential" or "inverse_square".
        success_radius: Success radius in units; None for the task's own.
        construction: Construction of the robots, "rigid" or, on Box2D alone, "jointed".
        hull_density: Density of all cells but the wheels; on Box2D alone if it is not 1.
        bodies: Bodies to drive instead of grown ones: a body for all genomes, or one for each, in
            any form that ``parse_body`` reads.
        perturbations: What happens to the robots in the scenarios that are sampled: damage, failing
            wheels, noise, and time to regrow; ``scenarios`` have their own.

    Returns:
        Arrays over genomes and episodes, see ``Evaluation``. Invalid bodies are not simulated and
        get 0.01 per correct part.

    Raises:
        GenomeError: The genomes have the wrong shape, or values that are not finite.
        TaskError, ScenarioError, BodyError: A setting is out of range.
        EngineSettingError: The engine is unknown or cannot use a setting, or ``workers`` is not a
            positive integer.
        EngineError: A worker was lost.
    """
    settings = TaskSettings(
        get_task(task).name, grid_size, distance_score, success_radius, construction, hull_density
    )
    checked = nca_layout(settings.task).check_genomes(genomes)
    if scenarios is not None and perturbations.is_any:
        raise ScenarioError(
            "perturbations are drawn with the scenarios; given scenarios hold their own damage, "
            "failure, noise and repair. Leave one of the two out."
        )
    if scenarios is None:
        sampling = ScenarioSampling(perturbations=perturbations)
        scenarios = sampling.draw(settings.task, seed, episodes, settings.grid_size)
    else:
        scenarios = scenario_rows(scenarios, len(checked))
    engine = resolve_engine(engine, settings, are_perturbed(scenarios))
    if workers is None and len(checked) < _WORTH_WORKERS and engine == "box2d":
        workers = 1
    with make_engine(engine, settings, workers) as running:
        return running.evaluate(checked, scenarios, bodies=bodies)
