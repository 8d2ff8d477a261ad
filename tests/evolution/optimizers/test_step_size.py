"""Step sizes: what they measure, apart from the search."""

import math

import numpy as np
import pytest

from ncrs.evolution.optimizers.step_size import PathLength, TwoPoints, step_size_of
from tests.evolution.optimizers.pycma_search import make_pair

N = 30


def make(step_size):
    _, pycma = make_pair("sep_cma_es", N, step_size=step_size, population=20, parents=None)
    return step_size_of(pycma._es)


def test_sigma_follows_the_length_of_its_path():
    path_length = make("csa")
    assert isinstance(path_length, PathLength)
    assert isinstance(make("decay"), PathLength)
    expected = math.sqrt(N) * (1.0 - 1.0 / (4.0 * N) + 1.0 / (21.0 * N**2))
    assert path_length.factor_of(expected) == pytest.approx(1.0, abs=1e-5)
    assert path_length.factor_of(2.0 * expected) > 1.1
    assert path_length.factor_of(0.0) < 0.9
    assert path_length.factor_of(1e9) == pytest.approx(math.e)  # no more than that at once


def test_two_points_lie_along_the_means_last_step_and_are_as_long_as_random_ones():
    two_points, generator = make("tpa"), np.random.default_rng(1)
    scales = np.linspace(0.5, 2.0, N)
    assert isinstance(two_points, TwoPoints)
    assert two_points.lines(scales, 0.1, generator).shape == (0, N)
    step = np.linspace(-3.0, 1.0, N)
    two_points.factor(1.0, step, np.zeros(20))
    squares = []
    for _ in range(1000):
        along, against = two_points.lines(scales, 0.1, generator)
        np.testing.assert_allclose(against, -along)
        np.testing.assert_allclose(along / np.linalg.norm(along), step / np.linalg.norm(step))
        squares.append(np.sum((along / scales) ** 2))
    assert np.mean(squares) == pytest.approx(N, rel=0.03)
    two_points.factor(1.0, np.zeros(N), np.zeros(20))
    assert two_points.lines(scales, 0.1, generator).shape == (0, N)


def test_sigma_grows_where_the_step_on_ranks_better_than_the_step_back():
    values = np.arange(20.0)
    for rank, grows in ((0, True), (19, False)):
        two_points = make("tpa")
        ordered = np.roll(values, -rank)  # the first has this rank, the second the next or the best
        assert (two_points.factor(1.0, np.ones(N), ordered) > 1.0) == grows
    assert make("tpa").factor(1.0, np.ones(N), np.zeros(20)) == 1.0
