import numpy as np
import pytest
import torch

from ncrs.automaton.device_genomes import DeviceGenomes
from ncrs.evolution.optimizers import make_optimizer
from ncrs.evolution.optimizers.cholesky_sampler import CholeskySampler
from ncrs.evolution.optimizers.cma_es import CMAES
from ncrs.evolution.optimizers.device_strategy import (
    DeviceStrategy,
    DiagonalStrategy,
    FullStrategy,
)
from ncrs.evolution.optimizers.settings import (
    CMAESSettings,
    CMAMESettings,
    IsoCMAESSettings,
    OptimizerError,
    SepCMAESSettings,
)
from ncrs.evolution.schema import StoredStateError
from tests.evolution.optimizers.pycma_search import PycmaSearch

DIMENSION = 30


class OnDevice(CMAES):
    """CMA-ES on a torch device, here the CPU."""

    def _make(self, start, sampler):
        template = self._make_pycma(start, sampler)
        seed = int(self._generator.integers(2**63))
        if sampler is None:
            return DiagonalStrategy(template, "cpu", start, seed)
        return FullStrategy(template, sampler, start, seed)


def _settings(kind=CMAESSettings, **changes):
    if kind is CMAESSettings:
        changes["precision"] = "float64"
    else:
        changes = {"step_size": "csa", "parents": None, **changes}
    return kind(population=12, sigma=0.5, **changes)


def _ellipsoid(genomes):
    scales = 10.0 ** (np.arange(DIMENSION) / (DIMENSION - 1))
    return -np.square((genomes - 1.0) * scales).sum(axis=1)


@pytest.mark.parametrize(
    ("kind", "changes"),
    [
        (CMAESSettings, {}),
        (CMAESSettings, {"parents": 3}),
        (SepCMAESSettings, {}),
        (SepCMAESSettings, {"parents": 3, "step_size": "decay"}),
        (IsoCMAESSettings, {}),
    ],
)
def test_it_makes_the_steps_that_pycma_makes(kind, changes, monkeypatch):
    seed = np.random.SeedSequence(1)
    reference = PycmaSearch(DIMENSION, seed, _settings(kind, **changes))
    ours = OnDevice(DIMENSION, seed, _settings(kind, **changes))
    normal = np.random.default_rng(2)
    drawn = []
    monkeypatch.setattr(reference._es.sm, "randn", lambda *shape: drawn[-1])
    monkeypatch.setattr(torch, "randn", lambda shape, **_: torch.from_numpy(drawn[-1]))
    for _ in range(150):
        drawn.append(normal.standard_normal((12, DIMENSION)))
        expected, genomes = reference.ask(), ours.ask()
        np.testing.assert_allclose(genomes, expected, rtol=1e-7, atol=1e-9)
        fitness = _ellipsoid(expected)
        reference.tell(fitness)
        ours.tell(fitness)
        assert ours.sigma == pytest.approx(reference.sigma, rel=1e-8)
    if kind is CMAESSettings:
        covariance = reference._es.sm.covariance()
        np.testing.assert_allclose(ours._es.sm.covariance(), covariance, rtol=1e-6)
    else:
        scales = reference._es.sigma_vec.scaling
        np.testing.assert_allclose(ours._es._scales.numpy(), scales, rtol=1e-8)
    condition = ours.metrics()["condition_number"]
    assert condition == pytest.approx(reference.metrics()["condition_number"], rel=1e-6)
    assert (condition > 1.5) == (kind is not IsoCMAESSettings)
    assert ours.sigma < 0.49


@pytest.mark.parametrize(
    "kind", [pytest.param(CMAESSettings, marks=pytest.mark.slow), SepCMAESSettings]
)
def test_it_reaches_the_optimum_of_an_ellipsoid(kind):
    search = OnDevice(DIMENSION, np.random.SeedSequence(3), _settings(kind))
    for _ in range(1500):
        search.tell(_ellipsoid(search.ask()))
    np.testing.assert_allclose(search.mean, 1.0, atol=1e-6)


@pytest.mark.parametrize("kind", [CMAESSettings, SepCMAESSettings])
def test_a_state_continues_bit_for_bit_also_while_a_population_is_pending(kind):
    settings = _settings(kind, restart_sigma=0.3)
    search = OnDevice(DIMENSION, np.random.SeedSequence(4), settings)
    for _ in range(20):
        search.tell(_ellipsoid(search.ask()))
    for pending in (False, True):
        if pending:
            search.ask()
        copy = OnDevice(DIMENSION, np.random.SeedSequence(99), settings)
        copy.load_state(search.state())
        again = OnDevice(DIMENSION, np.random.SeedSequence(98), settings)
        again.load_state(search.state())
        for _ in range(30):
            genomes = copy.ask()
            np.testing.assert_array_equal(again.ask(), genomes)
            copy.tell(_ellipsoid(genomes))
            again.tell(_ellipsoid(genomes))


def test_an_incomplete_state_is_refused():
    sampler = CholeskySampler(DIMENSION, None)
    search = OnDevice(DIMENSION, np.random.SeedSequence(5), _settings())
    template = search._make_pycma(np.zeros(DIMENSION), sampler)
    state = search._es.state()
    del state["pc"]
    fresh = FullStrategy(template, sampler, np.zeros(DIMENSION), 0)
    with pytest.raises(StoredStateError, match="pc"):
        fresh.load_state(state)


def test_step_sizes_of_pycma_alone_are_refused_on_a_gpu():
    for kind in (CMAESSettings, SepCMAESSettings, CMAMESettings):
        with pytest.raises(OptimizerError, match="step_size=tpa"):
            kind(step_size="tpa", device="cuda")


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU that torch can use")
@pytest.mark.parametrize("kind", [CMAESSettings, SepCMAESSettings])
def test_the_setting_device_keeps_the_search_on_the_gpu(kind):
    settings = _settings(kind, device="cuda")
    search = make_optimizer(settings, DIMENSION, np.random.SeedSequence(6))
    assert isinstance(search._es, DeviceStrategy)
    for _ in range(1500):
        search.tell(_ellipsoid(search.ask()))
    np.testing.assert_allclose(search.mean, 1.0, atol=1e-6)


def test_a_population_in_place_is_the_one_that_is_copied():
    seed = np.random.SeedSequence(7)
    copied = OnDevice(DIMENSION, seed, _settings())
    kept = OnDevice(DIMENSION, np.random.SeedSequence(7), _settings())
    for _ in range(3):
        expected, genomes = copied.ask(), kept.ask_in_place()
        assert isinstance(genomes, DeviceGenomes)
        fitness = _ellipsoid(expected)
        copied.tell(fitness)
        kept.tell(fitness)
        assert genomes.copied <= 1  # the best so far
        np.testing.assert_array_equal(np.asarray(genomes), expected)


def test_a_search_resumes_while_a_population_is_in_place():
    first = OnDevice(DIMENSION, np.random.SeedSequence(8), _settings())
    first.tell(_ellipsoid(first.ask()))
    pending = first.ask_in_place()
    second = OnDevice(DIMENSION, np.random.SeedSequence(9), _settings())
    second.load_state(first.state())
    np.testing.assert_array_equal(second.ask(), np.asarray(pending))
