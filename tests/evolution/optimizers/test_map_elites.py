"""MAP-Elites: its first genomes and its two operators."""

import numpy as np
import pytest

from ncrs.evolution.archive import AddResult, Archive, MeasureSpace
from ncrs.evolution.optimizers import MAPElitesSettings, make_optimizer

DIMENSION = 1000
SPACE = MeasureSpace(1, 2, 9)
NOTHING = AddResult(np.full(64, -1), np.zeros(64, dtype=np.int8), np.full(64, np.nan))


def make(elites=(), **settings):
    settings = {"population": 64, "initial_genomes": 0, **settings}
    record = MAPElitesSettings(**settings)
    optimizer = make_optimizer(record, DIMENSION, np.random.SeedSequence(0))
    archive = Archive(SPACE, DIMENSION, grid_size=3)
    optimizer.attach(archive)
    if len(elites):
        count = len(elites)
        archive.add(elites, np.ones(count), SPACE.triples[:count], np.zeros((count, 3, 3)))
    return optimizer


def test_the_first_genomes_are_normal_and_so_are_all_while_the_archive_is_empty():
    optimizer = make(initial_sigma=0.3, initial_genomes=128)
    for _ in range(4):
        genomes = optimizer.ask()
        assert genomes.shape == (64, DIMENSION)
        assert genomes.std() == pytest.approx(0.3, rel=0.02)
        optimizer.tell(np.zeros(64), NOTHING)


def test_variation_begins_after_the_first_genomes():
    optimizer = make(np.full((1, DIMENSION), 50.0), initial_genomes=65)
    means = []
    for _ in range(3):
        means.append(optimizer.ask().mean())
        optimizer.tell(np.zeros(64), NOTHING)
    assert [mean > 40 for mean in means] == [False, False, True]


def test_iso_line_children_lie_about_the_line_through_two_elites():
    ends = np.zeros((2, DIMENSION))
    ends[1, 0] = 10.0
    children = make(ends, sparse_fraction=0.0, iso_sigma=0.01, line_sigma=0.2).ask()
    # Across the line the noise is iso_sigma; along it, line_sigma times the distance of the two.
    assert children[:, 1:].std() == pytest.approx(0.01, rel=0.02)
    along = np.minimum(np.abs(children[:, 0]), np.abs(children[:, 0] - 10.0))
    assert 0.5 < along[along > 0.05].std() < 2.5
    assert (along > 0.05).mean() == pytest.approx(0.5, abs=0.2)  # half of the pairs are one elite


def test_sparse_children_differ_in_few_weights_or_many_by_little_or_much():
    optimizer = make(
        np.full((1, DIMENSION), 1.0),
        sparse_fraction=1.0,
        sparse_sigma_min=0.01,
        sparse_sigma_max=1.0,
    )
    changes = np.concatenate([optimizer._sparse_children(64) - 1.0 for _ in range(8)])
    mutated = (np.abs(changes) > 0).sum(axis=1)
    assert mutated.min() == 1
    assert mutated.max() > 900
    # Log-uniform: as many with 1 to 10 weights as with 100 to 1000.
    thirds = np.histogram(np.log10(mutated), bins=[0.0, 1.0, 2.0, 3.01])[0] / len(mutated)
    np.testing.assert_allclose(thirds, 1 / 3, atol=0.08)
    sizes = np.array([row[row != 0].std() for row in changes[mutated > 100]])
    assert 0.008 < sizes.min() < 0.02
    assert 0.5 < sizes.max() < 1.2
    assert np.median(sizes) == pytest.approx(0.1, rel=0.5)
