"""The search with variances only: pycma's, bit for bit, and its state is complete."""

import numpy as np
import pytest

from ncrs.evolution.optimizers import OptimizerError
from ncrs.evolution.optimizers.pycma import cma
from ncrs.evolution.optimizers.separable_strategy import SeparableStrategy
from tests.evolution.optimizers.pycma_search import make_pair

SMALL = {"population": 20, "sigma": 0.1, "parents": None}


def ellipsoid(population):
    weights = 10.0 ** np.linspace(0, 2, population.shape[1])
    return -((population - 0.3) ** 2 * weights).sum(axis=1)


def assert_equal_steps(ours, pycma, generations, objective=ellipsoid):
    """Assert that two searches ask for the same genomes and learn the same, to the last bit."""
    for _ in range(generations):
        population = ours.ask()
        np.testing.assert_array_equal(population, pycma.ask())
        fitness = objective(population)
        ours.tell(fitness)
        pycma.tell(fitness)
        np.testing.assert_array_equal(ours.mean, pycma.mean)
        assert ours.metrics() == pycma.metrics()
    scales = np.broadcast_to(pycma._es.sigma_vec.scaling, ours.mean.shape)
    np.testing.assert_array_equal(ours._es.scales, scales)
    assert isinstance(ours._es, SeparableStrategy)
    assert isinstance(pycma._es, cma.CMAEvolutionStrategy)


@pytest.mark.parametrize("parents", [None, 3, 20])
@pytest.mark.parametrize("step_size", ["csa", "tpa", "decay"])
@pytest.mark.parametrize("name", ["sep_cma_es", "iso_cma_es"])
def test_it_is_pycmas_search_bit_for_bit(name, step_size, parents):
    pair = make_pair(name, 30, step_size=step_size, **{**SMALL, "parents": parents})
    assert_equal_steps(*pair, 120)


@pytest.mark.parametrize("step_size", ["csa", "tpa"])
def test_it_is_pycmas_search_where_many_values_are_equal(step_size):
    def steps(population):
        return np.round(ellipsoid(population))

    pair = make_pair("sep_cma_es", 7, step_size=step_size, **SMALL)
    assert_equal_steps(*pair, 120, steps)


@pytest.mark.parametrize("settings", [{}, {"step_size": "csa", "parents": None}])
def test_it_is_pycmas_search_at_the_papers_size(settings):
    assert_equal_steps(*make_pair("sep_cma_es", 4572, **settings), 12)


def test_it_is_pycmas_search_after_restarts_and_from_a_state():
    settings = {**SMALL, "step_size": "csa", "restart_sigma": 0.09, "restart_from": "best"}
    ours, pycma = make_pair("sep_cma_es", 30, **settings)
    genome = np.linspace(-1.0, 1.0, 30)
    for search in (ours, pycma):
        search.start_from(genome)
    assert_equal_steps(ours, pycma, 100)
    assert ours.metrics()["restarts"] > 0
    resumed, _ = make_pair("sep_cma_es", 30, seed=4, **settings)
    resumed.load_state(ours.state())
    assert_equal_steps(resumed, pycma, 60)


@pytest.mark.parametrize("settings", [{"population": 5}, {"parents": 1}, {"parents": 2}])
def test_pycma_itself_searches_where_it_adds_mirror_images(settings):
    ours, pycma = make_pair("sep_cma_es", 9, **{**SMALL, **settings})
    assert isinstance(ours._es, cma.CMAEvolutionStrategy)
    for _ in range(20):
        population = ours.ask()
        np.testing.assert_array_equal(population, pycma.ask())
        ours.tell(ellipsoid(population))
        pycma.tell(ellipsoid(population))


def test_a_state_of_pycmas_strategy_is_refused_by_name():
    ours, pycma = make_pair("sep_cma_es", 30, **SMALL)
    state = pycma.state()
    with pytest.raises(
        OptimizerError, match=r"separable search lacks count, ps, scales: .*version"
    ):
        ours.load_state(state)


def test_populations_asked_for_do_not_change_later():
    ours, _ = make_pair("sep_cma_es", 30, **SMALL)
    first = ours.ask()
    kept = first.copy()
    ours.tell(ellipsoid(first))
    ours.ask()
    np.testing.assert_array_equal(first, kept)
