"""The steps of a generation, for a population that lies on a GPU."""

import numpy as np

from ncrs.automaton.device_genomes import DeviceGenomes
from ncrs.engines.batched import BatchedEngine
from ncrs.evolution.optimizers.cma_es import CMAES
from ncrs.evolution.optimizers.device_strategy import DiagonalStrategy
from ncrs.evolution.optimizers.settings import SepCMAESSettings
from ncrs.runs.published import load_champion
from ncrs.runs.settings import TrainConfig
from ncrs.training.generation import Generation
from ncrs.training.search import Search


class OnDevice(CMAES):
    """CMA-ES on a torch device, here the CPU."""

    def _make(self, start, sampler):
        template = self._make_pycma(start, sampler)
        return DiagonalStrategy(template, "cpu", start, 0)


def test_of_a_population_on_a_gpu_little_is_copied():
    chosen = SepCMAESSettings(sigma=1e-3, population=12, parents=None, step_size="csa")
    settings = TrainConfig(optimizer=chosen, symmetric=False, mirroring="none", episodes=4)
    search = Search(settings)
    optimizer = OnDevice(4572, np.random.SeedSequence(0), settings.optimizer)
    optimizer.start_from(np.asarray(load_champion("light_chase/best").genome, dtype=np.float64))
    search._optimizer = optimizer
    genomes = search.ask()
    assert isinstance(genomes, DeviceGenomes)
    scenarios = search.draw(0, len(genomes))
    array = np.asarray(genomes)
    evaluation = BatchedEngine(settings.task).evaluate(array, scenarios.rows)
    genomes.copied = 0
    added = search.add(genomes, evaluation, scenarios, 0)
    elites = len(search.archive)
    assert 1 <= elites <= len(genomes)
    assert genomes.copied == elites
    search.tell(evaluation, added)
    generation = Generation(0, genomes, evaluation, added)
    best = int(np.argmax(search.objective(evaluation)))
    np.testing.assert_array_equal(search.candidates(generation)["sample"], array[best])
    assert genomes.copied == elites + 2  # the optimizer's best so far, and the candidate
