import numpy as np
import pytest

from ncrs.evolution.optimizers.constants import Constants
from tests.evolution.optimizers.pycma_search import make_pair

N = 30


def read(name="sep_cma_es", **settings):
    _, pycma = make_pair(name, N, population=20, **settings)
    return Constants.read(pycma._es)


def test_parents_have_positive_weights_and_the_worst_genomes_negative_ones():
    constants = read(parents=7)
    weights = constants.weights(20)
    assert constants.parents == 7
    assert (weights[:7] > 0.0).all()
    assert (weights[7:13] == 0.0).all()
    assert (weights[13:] < 0.0).all()
    assert (np.diff(weights) <= 0.0).all()
    assert weights[:7].sum() == pytest.approx(1.0)
    assert constants.effective == pytest.approx(1.0 / np.square(weights[:7]).sum())


def test_a_long_path_of_sigma_holds_the_path_of_the_covariance():
    constants = read()
    short, long = constants.path(float(N), 10_000), constants.path(3.0 * N, 10_000)
    assert (short.h, long.h) == (1.0, 0.0)
    assert short.kept == long.kept == 1.0 - constants.cc
    assert short.kept**2 + short.added**2 / constants.effective == pytest.approx(1.0)
    assert long.added == 0.0
    assert short.rate == constants.c1
    assert long.rate == pytest.approx(constants.c1 * (1.0 - constants.cc) ** 2)


def test_the_first_generations_count_as_the_path_starts_at_zero():
    constants = read(parents=None)
    assert constants.path(0.9 * N, 10_000).h == 1.0
    assert constants.path(0.9 * N, 1).h == 0.0


@pytest.mark.parametrize("step_size", ["csa", "tpa"])
def test_rates_of_the_covariance_depend_on_its_kind(step_size):
    kinds = ("cma_es", "sep_cma_es", "iso_cma_es")
    full, diagonal, none = (read(kind, step_size=step_size, parents=None) for kind in kinds)
    assert 0.0 < full.c1 < diagonal.c1 < 1.0
    assert 0.0 < full.cmu < diagonal.cmu < 1.0
    assert none.c1 == none.cmu == 0.0
    assert full.cs == diagonal.cs == none.cs
    assert full.gain == pytest.approx(np.sqrt(full.cs * (2.0 - full.cs)))
