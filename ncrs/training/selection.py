"""The choice of a run's champion."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs.engines.base import Engine
from ncrs.evolution.objective import Objective
from ncrs.evolution.schema import check_like, check_names
from ncrs.runs.champion import Champion
from ncrs.runs.seeds import Stream, seed_sequence
from ncrs.runs.settings import TrainConfig
from ncrs_envs.mirroring import ScenarioSampling


class ChampionSelection:
    """Keeps the best of all candidates, on the same scenarios for the whole run.

    Args:
        config: Settings of the run.
        objective: Value by which candidates are compared.
    """

    def __init__(self, config: TrainConfig, objective: Objective) -> None:
        self._task = config.task
        self._objective = objective
        # The paper's placements, whatever the training's are, but its perturbations.
        self._scenarios = ScenarioSampling(perturbations=config.perturbations).draw(
            config.task.task,
            seed_sequence(config.seed, Stream.CHAMPION),
            config.champion_episodes,
            config.task.grid_size,
        )
        self._best = -np.inf
        self.champion: Champion | None = None
        """Best candidate so far; None until one has a body that the task can use."""

    def crown(
        self, candidates: Mapping[str, NDArray[np.float64]], engine: Engine, generation: int
    ) -> None:
        """Evaluate candidates; one that beats the champion takes its place.

        Args:
            candidates: Genomes, ``(N,)``, by source, see ``Champion.source``.
            engine: Engine for the run's task.
            generation: Index of their generation.
        """
        genomes = np.stack(list(candidates.values()))
        result = engine.evaluate(genomes, self._scenarios)
        values = self._objective(result)
        for index, source in enumerate(candidates):
            value = float(values[index])
            beaten = value <= self._best
            if not result.valid[index] or not np.isfinite(value) or beaten:
                continue
            self._best = value
            self.champion = Champion(
                genome=genomes[index].astype(np.float32),
                body=result.bodies[index],
                task=self._task,
                fitness=float(result.fitness[index]),
                success=float(result.success[index].mean()),
                generation=generation,
                source=source,
            )

    def state(self) -> dict[str, Any]:
        """Return arrays and JSON values for a checkpoint."""
        champion = None if self.champion is None else self.champion.state()
        return {"objective": float(self._best), "champion": champion}

    def load_state(self, state: Mapping[str, Any]) -> None:
        """Continue from a ``state``; raise ``StoredStateError`` if it is incomplete or foreign."""
        check_names(state, ("objective", "champion"), "The selection's state", ())
        check_like(state["objective"], 0.0, "objective", may_be_infinite=True)
        self._best = state["objective"]
        champion = state["champion"]
        self.champion = None if champion is None else Champion.from_state(champion)
