"""The archive: its triples, its rule of acceptance, and its statistics."""

import tracemalloc
from itertools import product

import numpy as np
import pytest
import torch

from ncrs.automaton.device_genomes import DeviceGenomes
from ncrs.evolution.archive import AddStatus, Archive, ArchiveError, MeasureSpace
from ncrs.runs.checkpoint import read_state, write_state

SPACE = MeasureSpace(min_sensors=1, min_wheels=2, max_cells=9)
DIMENSION = 4


def make():
    return Archive(SPACE, DIMENSION, grid_size=3)


def offer(archive, measures, fitness, genomes=None, **others):
    count = len(fitness)
    genomes = np.arange(count * DIMENSION).reshape(count, -1) if genomes is None else genomes
    bodies = np.full((count, 3, 3), np.arange(count)[:, None, None], dtype=np.int8)
    return archive.add(
        genomes, np.asarray(fitness, dtype=float), np.array(measures), bodies, **others
    )


def test_genomes_of_one_triple_are_judged_in_turn_and_the_best_is_kept():
    archive = make()
    triples = [[1, 2, 5]] * 4 + [[2, 2, 5]]
    added = offer(archive, triples, [0.2, 0.5, 0.4, np.nan, 0.6])
    new, improved, none = AddStatus.NEW, AddStatus.IMPROVED, AddStatus.NONE
    assert added.status.tolist() == [new, improved, none, none, new]
    np.testing.assert_allclose(added.improvement, [0.2, 0.3, -0.1, np.nan, 0.6])
    assert archive.column("fitness").tolist() == [0.5, 0.6]
    assert archive.column("genomes")[:, 0].tolist() == [1 * DIMENSION, 4 * DIMENSION]
    assert archive.column("bodies")[:, 0, 0].tolist() == [1, 4]


@pytest.mark.parametrize(
    ("sensors", "side", "count"), [(1, 5, 2300), (2, 5, 2024), (1, 3, 84), (1, 9, 85320)]
)
def test_number_of_possible_triples(sensors, side, count):
    space = MeasureSpace(sensors, 2, side * side)
    assert len(space.triples) == count
    np.testing.assert_array_equal(space.cells(space.triples), np.arange(count))


def test_the_triples_are_those_of_the_rule():
    rule = [
        (sensors, wheels, cells)
        for sensors, wheels, cells in product(range(10), repeat=3)
        if sensors >= 1 and wheels >= 2 and sensors + wheels <= cells <= 9
    ]
    assert [tuple(row) for row in SPACE.triples.tolist()] == rule
    others = [row for row in product(range(-1, 12), repeat=3) if row not in set(rule)]
    assert (SPACE.cells(np.array(others)) == -1).all()


def test_only_elites_take_memory_whatever_the_number_of_triples():
    tracemalloc.start()
    try:
        archive = Archive(MeasureSpace(1, 2, 15**2), dimension=4572, grid_size=15)
        genomes = np.ones((100, 4572), dtype=np.float32)
        triples = archive.space.triples[::1000][:100]
        bodies = np.zeros((100, 15, 15), dtype=np.int8)
        archive.add(genomes, np.ones(100), triples, bodies)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(archive.space.triples) == 1_873_200
    assert len(archive) == 100
    assert peak < 300e6  # one row for each triple would take 34 GB


def test_elites_keep_their_cells_while_rows_are_added_and_dropped():
    archive = make()
    order = np.random.default_rng(0).permutation(len(SPACE.triples))
    for cell in order:
        triple = SPACE.triples[cell]
        offer(archive, [triple], [0.5], generation=int(cell))
    np.testing.assert_array_equal(archive.cells, np.arange(84))
    np.testing.assert_array_equal(archive.column("generations"), np.arange(84))
    kept = np.arange(84) % 3 > 0
    estimates = np.where(kept, 0.25, np.nan)
    archive.replace_estimates(estimates, np.zeros(84), 0.0, np.zeros(4, dtype=np.int64))
    np.testing.assert_array_equal(archive.cells, np.flatnonzero(kept))
    np.testing.assert_array_equal(archive.column("generations"), np.flatnonzero(kept))
    added = offer(archive, [SPACE.triples[0], SPACE.triples[1]], [0.1, 0.2])
    assert added.status.tolist() == [AddStatus.NEW, AddStatus.NONE]
    assert archive.column("fitness")[0] == 0.1


def test_a_genome_gets_in_if_it_is_new_or_better():
    archive = make()
    first = offer(archive, [(1, 2, 3), (1, 2, 4)], [0.5, 0.25])
    assert first.status.tolist() == [AddStatus.NEW, AddStatus.NEW]
    assert first.improvement.tolist() == [0.5, 0.25]
    second = offer(archive, [(1, 2, 3), (1, 2, 4), (2, 2, 4)], [0.5, 0.375, 0.125], generation=7)
    assert second.status.tolist() == [AddStatus.NONE, AddStatus.IMPROVED, AddStatus.NEW]
    assert second.improvement.tolist() == [0.0, 0.125, 0.125]
    assert len(archive) == 3
    assert archive.measures.tolist() == [[1, 2, 3], [1, 2, 4], [2, 2, 4]]
    assert archive.column("fitness").tolist() == [0.5, 0.375, 0.125]
    assert archive.column("generations").tolist() == [0, 7, 7]
    np.testing.assert_array_equal(archive.column("genomes")[0], [0, 1, 2, 3])
    np.testing.assert_array_equal(archive.column("genomes")[1], [4, 5, 6, 7])
    np.testing.assert_array_equal(archive.column("bodies")[:, 0, 0], [0, 1, 2])


def test_genomes_are_offered_one_after_the_other():
    added = offer(make(), [(1, 2, 3)] * 3, [0.25, 0.75, 0.5])
    assert added.status.tolist() == [AddStatus.NEW, AddStatus.IMPROVED, AddStatus.NONE]
    assert added.improvement.tolist() == [0.25, 0.5, -0.25]


def test_nan_and_invalid_bodies_never_enter():
    archive = make()
    added = offer(archive, [(1, 2, 3), (-1, -1, -1)], [np.nan, 0.9])
    assert added.cells.tolist() == [-1, -1]
    assert added.status.tolist() == [AddStatus.NONE, AddStatus.NONE]
    assert np.isnan(added.improvement).all()
    assert len(archive) == 0
    assert archive.best_genome() is None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"fitness": [0.5, np.inf]}, r"infinite.*\[1\]"),
        ({"genomes": np.zeros((2, 5))}, r"genomes must have shape \(2, 4\), got \(2, 5\)"),
        ({"measures": [(1, 2, 3)]}, r"measures must have shape \(2, 3\)"),
    ],
)
def test_what_does_not_fit_is_refused_whole(change, message):
    archive = make()
    with pytest.raises(ArchiveError, match=message):
        offer(archive, **{"measures": [(1, 2, 3), (1, 2, 4)], "fitness": [0.5, 0.5], **change})
    assert len(archive) == 0


def test_statistics_use_both_denominators():
    archive = make()
    assert archive.statistics()["filled"] == 0.0
    assert "best" not in archive.statistics()
    offer(
        archive,
        [(1, 2, 3), (1, 2, 4), (1, 2, 5)],
        [0.5, 0.25, 0.45],
        success=np.array([1.0, 0.0, 0.5]),
        standing_still=0.445,
    )
    statistics = archive.statistics()
    expected = {
        "filled": 3.0, "filled_fraction": 3 / 84, "filled_fraction_of_2024": 3 / 2024,
        "qd_score": 1.2 / 84, "qd_score_of_2024": 1.2 / 2024, "best": 0.5, "mean": 0.4,
        "beat_standing_still": 1.0, "succeed": 2.0,
    }  # fmt: skip
    assert statistics == pytest.approx(expected)


def test_drawing_takes_elites_only_and_evenly():
    archive = make()
    with pytest.raises(ArchiveError, match="empty"):
        archive.draw(np.random.default_rng(0), 1)
    genomes = np.array([[1.0] * 4, [2.0] * 4, [3.0] * 4])
    offer(archive, [(1, 2, 3), (3, 2, 6), (1, 2, 3)], [0.5, 0.25, 0.75], genomes)
    drawn = archive.draw(np.random.default_rng(0), 4000)
    assert drawn.dtype == np.float64
    values, counts = np.unique(drawn[:, 0], return_counts=True)
    assert values.tolist() == [2.0, 3.0]
    assert abs(counts[0] - 2000) < 150  # 5 standard deviations are 158
    np.testing.assert_array_equal(archive.best_genome(), [3.0] * 4)


def test_new_estimates_replace_the_old_and_nan_leaves():
    archive = make()
    offer(archive, [(1, 2, 3), (1, 2, 4)], [0.9, 0.5], generation=3)
    archive.replace_estimates(
        np.array([0.4, np.nan]), np.array([0.25, 0.0]), 0.3, np.array([9, 4, 1, -1])
    )
    assert archive.measures.tolist() == [[1, 2, 3]]
    assert archive.column("fitness").tolist() == [0.4]
    assert archive.column("success").tolist() == [0.25]
    assert archive.column("standing_still").tolist() == [0.3]
    assert archive.column("seeds").tolist() == [[9, 4, 1, -1]]
    assert archive.column("generations").tolist() == [3]
    seeds = np.zeros(4, dtype=np.int64)
    for values, message in [
        ((np.zeros(2), np.zeros(2), 0.0, seeds), r"fitness must have shape \(1,\)"),
        ((np.zeros(1), np.zeros(1), 0.0, seeds[:3]), r"seeds must have shape \(1, 4\)"),
        ((np.zeros(1), np.zeros(1), np.zeros(2), seeds), r"standing_still must have shape \(1,\)"),
        ((np.full(1, np.inf), np.zeros(1), 0.0, seeds), "infinite"),
    ]:
        with pytest.raises(ArchiveError, match=message):
            archive.replace_estimates(*values)
    assert archive.column("fitness").tolist() == [0.4]


def test_the_state_goes_through_a_file_unchanged(tmp_path):
    archive = make()
    generator = np.random.default_rng(1)
    rows = SPACE.triples[generator.integers(84, size=40)]
    offer(archive, rows, generator.random(40), generator.normal(size=(40, 4)))
    write_state(tmp_path / "archive.npz", archive.state())
    again = Archive.from_state(read_state(tmp_path / "archive.npz"))
    other = make()
    offer(other, [(7, 2, 9)], [5.0])  # what was there before must go
    other.load_state(archive.state())
    for copy in (again, other):
        assert copy.space == SPACE
        np.testing.assert_array_equal(copy.cells, archive.cells)
        for name in ("genomes", "bodies", "fitness", "generations", "seeds"):
            np.testing.assert_array_equal(copy.column(name), archive.column(name))


def test_a_foreign_state_is_refused_and_changes_nothing():
    archive = Archive(SPACE, 5, grid_size=3)
    archive.add(np.zeros((1, 5)), np.array([0.5]), np.array([[1, 2, 3]]), np.zeros((1, 3, 3)))
    with pytest.raises(ArchiveError, match="dimension is 4, expected 5"):
        archive.load_state(make().state())
    damaged = archive.state()
    damaged["elites"]["fitness"] = np.array([np.nan])
    with pytest.raises(ArchiveError, match="not finite"):
        archive.load_state(damaged)
    for cells in ([500], [-1], [0.0], [[0]], [0, 0]):
        with pytest.raises(ArchiveError, match="its cells must be integers from 0 to 83"):
            archive.load_state({**archive.state(), "cells": np.array(cells)})
    assert archive.column("fitness").tolist() == [0.5]


def test_of_genomes_on_a_gpu_only_new_elites_are_copied():
    rows = np.arange(5.0 * DIMENSION).reshape(5, -1)
    expected, archive = make(), make()
    triples, fitness = [[1, 2, 5]] * 4 + [[2, 2, 5]], [0.2, 0.5, 0.4, np.nan, 0.6]
    offer(expected, triples, fitness, rows)
    genomes = DeviceGenomes(torch.from_numpy(rows))
    offer(archive, triples, fitness, genomes)
    assert genomes.copied == 2
    np.testing.assert_array_equal(archive.column("genomes"), expected.column("genomes"))
