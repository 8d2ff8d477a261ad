"""Fast engine: NCA, physics and scoring fused into numba kernels, with threads over genomes."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import FIRST_EXCEPTION, Future, ThreadPoolExecutor, wait

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import growth_steps
from ncrs.engines.arguments import GivenBodies, ScenarioRows, happens_in
from ncrs.engines.base import (
    Engine,
    EngineSettingError,
    EvaluationInterrupted,
    RolloutResult,
    StopCheck,
)
from ncrs.engines.nca_kernels import IntArray, Network, pack_genomes
from ncrs.engines.perturbed_rollout import Perturbed, roll_out_perturbed
from ncrs.engines.rollout_kernels import (
    Grown,
    Rollout,
    grow_population,
    make_outcomes,
    make_workspace,
    roll_out_population,
)
from ncrs_envs.batched.layout import Scenarios
from ncrs_envs.batched.perturbations import Perturbations, perturbation_records
from ncrs_envs.batched.records import scenario_records, settings_record
from ncrs_envs.drawing import DrawnRows
from ncrs_envs.tasks import MAX_EPISODE_STEPS, TaskSettings

_POLL_S = 0.05
_GROWTH_CHUNK = 16
"""Genomes per job; growing a single one takes less time than handing it to a thread."""


class BatchedEngine(Engine):
    """``Engine`` on the batched simulator; ``workers`` is the number of threads of this process.

    The kernels are compiled on first use, which takes under a minute, and cached on disk.
    """

    name = "batched"

    def __init__(self, settings: TaskSettings, workers: int | None = None) -> None:
        check_compiled_rules(settings)
        super().__init__(settings, workers)

    def _rollout(
        self,
        genomes: NDArray[np.float32],
        rows: ScenarioRows,
        should_stop: StopCheck,
        bodies: GivenBodies,
    ) -> RolloutResult:
        settings = self.settings
        population, episodes, n = len(genomes), len(rows[0]), settings.grid_size
        growth, control = pack_genomes(genomes, self.layout)
        part_codes = np.array(self.layout.part_codes, dtype=np.int8)
        shape = (population, n, n)
        grown = Grown(
            np.zeros(shape, dtype=np.int8) if bodies is None else bodies,
            np.ones(population, dtype=np.bool_),
        )
        outcomes = make_outcomes(population, episodes, settings.task.distances)
        rollout = Rollout(
            networks=control,
            part_codes=part_codes,
            bodies=grown.bodies,
            settings=settings_record(settings),
            scenarios=scenario_table(rows, n),
            steps=MAX_EPISODE_STEPS,
        )

        def grow(chosen: IntArray) -> None:
            grow_population(growth, part_codes, growth_steps(n), chosen, grown)

        perturbed = perturbed_inputs(rows, growth, population, n)

        def roll_out(chosen: IntArray) -> None:
            if perturbed is None:
                workspace = make_workspace(n, episodes)
                roll_out_population(rollout, workspace, chosen, outcomes, None)
            else:
                workspace = make_workspace(n, 1, robots=2)
                roll_out_perturbed(rollout, perturbed, workspace, chosen, outcomes)

        for kernel in (grow, roll_out):
            kernel(np.arange(0))  # no genomes: compiles, or loads from disk
        if bodies is None:
            self._spread(grow, np.arange(population), _GROWTH_CHUNK, should_stop)
        valid = np.flatnonzero(settings.task.is_valid(grown.bodies))
        self._spread(roll_out, valid, 1, should_stop)
        recovered = None if perturbed is None else perturbed.recovered
        return RolloutResult(grown.bodies, *outcomes, grown=grown.finite, recovered=recovered)

    def _spread(
        self,
        work: Callable[[IntArray], None],
        genomes: IntArray,
        chunk: int,
        should_stop: StopCheck,
    ) -> None:
        """Apply ``work`` to all genomes, ``chunk`` at a time, on this engine's threads."""
        jobs = [genomes[start : start + chunk] for start in range(0, len(genomes), chunk)]
        with ThreadPoolExecutor(self.workers, thread_name_prefix="ncrs") as pool:
            futures: set[Future[None]] = {pool.submit(work, job) for job in jobs}
            try:
                while futures:
                    if should_stop():
                        raise EvaluationInterrupted
                    done, futures = wait(futures, _POLL_S, FIRST_EXCEPTION)
                    for future in done:
                        future.result()
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise


def check_compiled_rules(settings: TaskSettings) -> None:
    """Raise ``EngineSettingError`` if a task or its settings have rules that are not compiled."""
    if settings.needs_box2d:
        raise EngineSettingError(
            f"{settings.name} {settings.not_compiled}, which only Box2D runs: choose the "
            "engine box2d."
        )


def scenario_table(rows: ScenarioRows, grid_size: int) -> Scenarios:
    """Return the records of all scenarios, shape ``(rows, E)``."""
    if isinstance(rows, DrawnRows):
        return rows.records
    shape = (len(rows), len(rows[0]))
    flat = scenario_records([scenario for row in rows for scenario in row], grid_size)
    quads = flat.quads.reshape(*shape, -1)
    return Scenarios(flat.scenarios.reshape(shape), quads)


def perturbed_inputs(
    rows: ScenarioRows, growth: Network, population: int, grid_size: int
) -> Perturbed | None:
    """Return what a perturbed rollout needs; None if nothing happens to any robot.

    Args:
        rows: Scenarios, one row or one per genome.
        growth: Weights for growth of the whole population.
        population: Number of genomes.
        grid_size: Side of the body grid.
    """
    if not happens_in(rows):
        return None
    shape = (len(rows), len(rows[0]))
    flat = perturbation_records([scenario for row in rows for scenario in row], grid_size)
    table = Perturbations(
        flat.perturbations.reshape(shape),
        flat.damaged.reshape(*shape, -1),
        flat.failing.reshape(*shape, -1),
    )
    return Perturbed(growth, table, np.ones((population, shape[1])))
