"""The search: an optimizer, the archive that it fills, and the scenarios of each generation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import nca_layout
from ncrs.automaton.device_genomes import AnyGenomes
from ncrs.engines.base import Engine, Evaluation, StopCheck
from ncrs.evolution.archive import AddResult, ArchiveError
from ncrs.evolution.objective import Objective
from ncrs.evolution.optimizers import OptimizerError, make_optimizer
from ncrs.evolution.optimizers.base import Optimizer
from ncrs.evolution.reestimation import reestimate
from ncrs.evolution.space import WEIGHTS
from ncrs.evolution.standstill import standing_still_fitness
from ncrs.evolution.task_optimizer import TaskOptimizer
from ncrs.runs.elites import EliteArchive, make_archive
from ncrs.runs.engine_settings import ConfigError
from ncrs.runs.seeds import Stream, seed_row, seed_rows, seed_sequence
from ncrs.runs.settings import TrainConfig
from ncrs.training.generation import Generation
from ncrs.training.start import search_space
from ncrs_envs.batched.drawing import draw_rows
from ncrs_envs.drawing import draw_scenarios
from ncrs_envs.scenario import Scenario


@dataclass(frozen=True)
class DrawnScenarios:
    """Scenarios of a generation: one row for all genomes, or one for each."""

    rows: Sequence[Sequence[Scenario]]
    seeds: NDArray[np.int64]
    """Row of ``ncrs.runs.seeds`` for each row, ``(1 or P, 4)``."""


class Search:
    """The steps of a generation: ask, draw scenarios, add, tell.

    Args:
        config: Settings of the run.

    Raises:
        ConfigError: If the optimizer refuses a setting at this size, or ``start_from`` is missing
            or does not fit.
        InstallationError: If the installation is incomplete and has no champions to start from.
        CheckpointError: If the file to start from is damaged.
    """

    def __init__(self, config: TrainConfig) -> None:
        self._config = config
        self._layout = nca_layout(config.task.task)
        self._space = search_space(config)
        self._sampling = config.sampling()
        self.objective = Objective(
            config.task,
            config.success_bonus,
            config.approach_bonus,
            config.objective,
            config.recovery_bonus,
        )
        self.archive = make_archive(config.task)
        try:
            self._optimizer = self._new_optimizer()
        except OptimizerError as error:
            raise ConfigError(str(error)) from error
        if config.space == WEIGHTS:  # elites are no points of other spaces
            self._optimizer.attach(self.archive)

    def _new_optimizer(self) -> Optimizer:
        config = self._config
        seed = seed_sequence(config.seed, Stream.OPTIMIZER)
        optimizer = make_optimizer(config.optimizer, self._space.dimension, seed)
        if isinstance(optimizer, TaskOptimizer):
            optimizer.set_task(config.task.task)
        if self._space.start.any():
            optimizer.start_from(self._space.start)
        return optimizer

    def ask(self) -> AnyGenomes:
        """Propose the next population, ``(P, N)``, on the GPU if the search is there."""
        return self._searched(self._optimizer.ask_in_place())

    def draw(self, generation: int, population: int) -> DrawnScenarios:
        """Draw the scenarios of a generation of that many genomes."""
        config = self._config
        if config.common_scenarios:
            row, seeds = self._draw(Stream.SCENARIOS, generation, eased_at=generation)
            return DrawnScenarios([row], seeds[None])
        keys = [(int(Stream.SCENARIOS), generation, genome) for genome in range(population)]
        rows = draw_rows(
            self._sampling, config.task, config.seed, keys, config.episodes, generation
        )
        return DrawnScenarios(rows, seed_rows(config.seed, keys))

    def add(
        self,
        genomes: AnyGenomes,
        evaluation: Evaluation,
        scenarios: DrawnScenarios,
        generation: int,
    ) -> AddResult:
        """Offer the population to the archive.

        Raises:
            ArchiveError: If a fitness is infinite. Nothing is added then.
        """
        return self.archive.add(
            genomes,
            evaluation.fitness,
            evaluation.measures,
            evaluation.bodies,
            success=evaluation.success.mean(axis=1),
            standing_still=standing_still_fitness(self._config.task, scenarios.rows),
            generation=generation,
            seeds=scenarios.seeds,
        )

    def tell(self, evaluation: Evaluation, added: AddResult) -> None:
        """Let the optimizer learn from the population.

        Raises:
            OptimizerError: If the values are infinite, or all are NaN.
        """
        self._optimizer.tell(self.objective(evaluation), added)

    def reestimate(self, engine: Engine, generation: int, should_stop: StopCheck) -> int:
        """Estimate all elites on fresh scenarios; return the number dropped for NaN."""
        scenarios, seeds = self._draw(Stream.REESTIMATION, generation)
        return reestimate(self.archive, engine, scenarios, seeds, should_stop).dropped

    def candidates(self, generation: Generation) -> dict[str, NDArray[np.float64]]:
        """Return candidates for champion by source, see ``Champion.source``.

        They are the generation's best genome, and the mean of the search or the archive's best
        elite, which are often better than a lucky draw.
        """
        best = int(np.nanargmax(self.objective(generation.evaluation)))
        return {
            "sample": generation.genomes[best],
            self._optimizer.candidate_source: np.asarray(
                self._searched(self._optimizer.mean[None])
            )[0],
        }

    def metrics(self) -> dict[str, float]:
        """Compute the values of the optimizer's and the archive's curves."""
        return {
            **{f"optimizer/{key}": value for key, value in self._optimizer.metrics().items()},
            **{f"qd/{key}": value for key, value in self.archive.statistics().items()},
        }

    @property
    def elites(self) -> EliteArchive:
        """The archive as it is saved."""
        config = self._config
        return EliteArchive(config.task, self.archive, config.episodes, self._sampling)

    def state(self) -> dict[str, Any]:
        """Return arrays and JSON values for a checkpoint."""
        return {"optimizer": self._optimizer.state(), "archive": self.archive.state()}

    def load_state(self, state: Mapping[str, Any]) -> None:
        """Continue from a ``state``.

        Raises:
            ConfigError: If it is the state of another search.
        """
        try:
            self._optimizer.load_state(state["optimizer"])
            self.archive.load_state(state["archive"])
        except (OptimizerError, ArchiveError) as error:
            raise ConfigError(str(error)) from error

    def _draw(
        self, stream: Stream, *keys: int, eased_at: int | None = None
    ) -> tuple[Sequence[Scenario], NDArray[np.int64]]:
        config = self._config
        sequence = seed_sequence(config.seed, stream, *keys)
        scenarios = draw_scenarios(self._sampling, config.task, sequence, config.episodes, eased_at)
        return scenarios, seed_row(sequence)

    def _searched(self, points: AnyGenomes) -> AnyGenomes:
        """Return the genomes of points, the nearest symmetric ones if only those are searched."""
        config, genomes = self._config, points
        if config.space != WEIGHTS:
            genomes = self._space.genomes(np.asarray(points))
        is_symmetric = config.symmetric and config.optimizer.may_be_symmetric
        return self._layout.symmetric(genomes) if is_symmetric else genomes
