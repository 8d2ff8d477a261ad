"""The optimizer ``drafts``: bodies for every measure triple, with controllers by hand."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ncrs.automaton.channels import nca_layout
from ncrs.automaton.device_genomes import AnyGenomes
from ncrs.automaton.grow_to import GROWTH_UNITS, grow_each
from ncrs.drafts.bodies import draw_body
from ncrs.drafts.controllers import CONTROLLERS, controller_genomes
from ncrs.evolution.archive import AddResult
from ncrs.evolution.optimizers.base import Fitness, Genomes, State
from ncrs.evolution.optimizers.quality_diversity import QDOptimizer
from ncrs.evolution.optimizers.settings import DraftsSettings, OptimizerError
from ncrs.evolution.schema import check_like
from ncrs.evolution.task_optimizer import TaskOptimizer
from ncrs_envs.tasks import Task

_SEEDS = 2**31


class Drafts(TaskOptimizer, QDOptimizer):
    """Bodies drawn for random measure triples and grown by gradient descent.

    Each body gets all ``CONTROLLERS``; the archive keeps the best. Where descent did not reach a
    body within its steps, what does grow is evaluated.
    """

    settings: DraftsSettings

    def __init__(
        self, dimension: int, seed: np.random.SeedSequence, settings: DraftsSettings
    ) -> None:
        super().__init__(dimension, seed, settings)
        self._task: Task | None = None
        self._bodies = 0

    def set_task(self, task: Task) -> None:
        """Draw bodies and controllers for this task, see ``TaskOptimizer``."""
        length = nca_layout(task).num_parameters
        if length != self.dimension:
            raise OptimizerError(
                f"Genomes for {task.name} have {length} weights, this optimizer's {self.dimension}."
            )
        self._task = task

    def metrics(self) -> dict[str, float]:
        """Return the number of bodies drawn so far, per measure triple."""
        return {"bodies_per_triple": self._bodies / len(self._archive.space.triples)}

    @property
    def _bodies_per_generation(self) -> int:
        return -(-self.settings.population // len(CONTROLLERS))

    def _ask(self) -> Genomes:
        if self._task is None:
            raise OptimizerError("drafts needs a task: call set_task(task) first.")
        bodies = [
            draw_body(self._task, triple, self._archive.grid_size, self._generator)
            for triple in self._triples(self._bodies_per_generation)
        ]
        grown = grow_each(
            np.stack(bodies),
            nca_layout(self._task),
            GROWTH_UNITS,
            int(self._generator.integers(_SEEDS)),
            self.settings.descent_steps,
        )
        pairs = grown.genomes[:, None] + controller_genomes(self._task)
        return pairs.reshape(-1, self.dimension)[: self.settings.population].astype(np.float64)

    def _triples(self, count: int) -> list[list[int]]:
        """Draw measure triples, half of them among those without an elite while there are any."""
        triples, generator = self._archive.space.triples, self._generator
        empty = np.setdiff1d(np.arange(len(triples)), self._archive.cells)
        chosen = generator.choice(empty, min(len(empty), count // 2), replace=False)
        others = generator.integers(len(triples), size=count - len(chosen))
        drawn: list[list[int]] = triples[np.concatenate([chosen, others])].tolist()
        return drawn

    def _tell(self, asked: AnyGenomes, fitness: Fitness, added: AddResult | None) -> None:
        self._bodies += self._bodies_per_generation

    def _state(self) -> State:
        return {"bodies": self._bodies}

    def _load_state(self, state: Mapping[str, Any]) -> None:
        check_like(state["bodies"], 0, "bodies")
        self._bodies = state["bodies"]
