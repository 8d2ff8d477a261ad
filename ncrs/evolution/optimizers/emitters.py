"""CMA-ES emitters that take turns, as in CMA-ME and CMA-MAE."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.device_genomes import AnyGenomes
from ncrs.evolution.archive import AddResult
from ncrs.evolution.optimizers.base import Fitness, State
from ncrs.evolution.optimizers.cma_es import CMAES
from ncrs.evolution.optimizers.quality_diversity import QDOptimizer
from ncrs.evolution.optimizers.settings import EmitterSettings
from ncrs.evolution.schema import StoredStateError, check_like


class EmitterOptimizer(QDOptimizer):
    """Emitters that take turns; each generation is the population of one (paper section 5).

    An emitter restarts from a random elite when more than ``patience`` of its turns in a row have
    added nothing to the archive, neither a new elite nor a better one, and there are more elites
    than emitters.

    Args:
        dimension: Length N of a genome.
        seed: Seed for choosing elites; the emitters' seeds follow from it.
        settings: Record of the optimizer's settings.
    """

    settings: EmitterSettings

    def __init__(
        self, dimension: int, seed: np.random.SeedSequence, settings: EmitterSettings
    ) -> None:
        super().__init__(dimension, seed, settings)
        self._emitters = [
            CMAES(dimension, child, settings.emitter) for child in seed.spawn(settings.emitters)
        ]
        # Each emitter's state after its last turn, copied then, so that a checkpoint need not copy
        # all of them in one generation.
        self._kept: list[State | None] = [None] * len(self._emitters)
        self._turn = 0
        self._idle = [0] * len(self._emitters)
        self._restarts = 0

    def metrics(self) -> dict[str, float]:
        """Return the emitters' step sizes, restarts and the longest wait for a useful turn."""
        sigmas = [emitter.sigma for emitter in self._emitters]
        return {
            "sigma": float(np.median(sigmas)),
            "sigma_min": min(sigmas),
            "sigma_max": max(sigmas),
            "restarts": float(self._restarts),
            "longest_idle": float(max(self._idle)),
        }

    def start_from(self, genome: NDArray[np.float64]) -> None:
        """Search around ``genome``, ``(N,)``, with all emitters."""
        for emitter in self._emitters:
            emitter.start_from(genome)
        self._kept = [None] * len(self._emitters)

    @abstractmethod
    def _judge(self, fitness: Fitness, added: AddResult) -> tuple[Fitness, bool]:
        """Return the values that the emitter maximises, ``(P,)``, and True for a useful turn."""

    def _ask(self) -> AnyGenomes:
        return self._emitters[self._turn].ask_in_place()

    def _tell(self, asked: AnyGenomes, fitness: Fitness, added: AddResult | None) -> None:
        assert added is not None  # checked by tell
        turn = self._turn
        values, useful = self._judge(fitness, added)
        self._emitters[turn].tell(values)
        self._idle[turn] = 0 if useful else self._idle[turn] + 1
        if self._idle[turn] > self.settings.patience and len(self._archive) > len(self._emitters):
            self._emitters[turn].restart(self._archive.draw(self._generator, 1)[0])
            self._idle[turn] = 0
            self._restarts += 1
        # On a GPU the copy takes longer than the turn: all are copied when a checkpoint is due.
        on_gpu = self.settings.device != "cpu"
        self._kept[turn] = None if on_gpu else self._emitters[turn].state()
        self._turn = (turn + 1) % len(self._emitters)

    def _emitter_state(self, index: int) -> State:
        if self._asked is not None and index == self._turn:
            return self._emitters[index].state()
        kept = self._kept[index]
        if kept is None:
            kept = self._kept[index] = self._emitters[index].state()
        return kept

    def _state(self) -> State:
        return {
            "turn": self._turn,
            "idle": list(self._idle),
            "restarts": self._restarts,
            "emitters": [self._emitter_state(index) for index in range(len(self._emitters))],
        }

    def _load_state(self, state: Mapping[str, Any]) -> None:
        count = len(self._emitters)
        check_like(state["turn"], 0, "turn")
        check_like(state["restarts"], 0, "restarts")
        check_like(state["idle"], [], "idle")
        lengths = (len(state["emitters"]), len(state["idle"]))
        if lengths != (count, count) or not 0 <= state["turn"] < count:
            raise StoredStateError(f"The state is not of {count} emitters: it has {lengths[0]}.")
        for emitter, its_state in zip(self._emitters, state["emitters"], strict=True):
            emitter.load_state(its_state)
        self._kept = [None] * len(self._emitters)
        self._turn = state["turn"]
        self._idle = list(state["idle"])
        self._restarts = state["restarts"]
