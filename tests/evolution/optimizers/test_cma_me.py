"""CMA-ME and CMA-MAE: ranking, thresholds, turns and restarts, on hand-made additions."""

import numpy as np
import pytest

from ncrs.evolution.archive import AddResult, AddStatus, Archive, MeasureSpace
from ncrs.evolution.optimizers import OPTIMIZERS, make_optimizer

DIMENSION = 6
SPACE = MeasureSpace(1, 2, 9)


def make(name="cma_me", **settings):
    settings = {"population": 5, "emitters": 3, "sigma": 0.1, "diagonal": True, **settings}
    record = OPTIMIZERS[name].settings(**settings)
    optimizer = make_optimizer(record, DIMENSION, np.random.SeedSequence(0))
    archive = Archive(SPACE, DIMENSION, grid_size=3)
    optimizer.attach(archive)
    return optimizer, archive


def additions(rows):
    cells, status, improvement = zip(*rows, strict=True)
    return AddResult(
        np.array(cells), np.array(status, dtype=np.int8), np.array(improvement, dtype=float)
    )


NOTHING = additions([(0, AddStatus.NONE, -0.1)] * 5)
FITNESS = np.array([0.01, 0.9, 0.5, 0.2, 0.02])
MIXED = additions(
    [
        (-1, AddStatus.NONE, np.nan),
        (3, AddStatus.NONE, -0.05),
        (4, AddStatus.IMPROVED, 0.3),
        (5, AddStatus.NEW, 0.2),
        (-1, AddStatus.NONE, np.nan),
    ]
)


def order(values):
    return np.argsort(-values).tolist()


def test_improvement_ranks_new_before_improved_before_the_rest_before_invalid():
    values, useful = make()[0]._judge(FITNESS, MIXED)
    assert order(values) == [3, 2, 1, 4, 0]
    assert useful


def test_within_a_stage_the_larger_improvement_leads():
    added = additions([(0, AddStatus.NEW, 0.3), (1, AddStatus.NEW, 0.4),
                       (2, AddStatus.IMPROVED, 0.9), (3, AddStatus.IMPROVED, 0.8),
                       (4, AddStatus.NONE, -0.2)])  # fmt: skip
    assert order(make()[0]._judge(FITNESS, added)[0]) == [1, 0, 2, 3, 4]


def test_fitness_ranking_ignores_the_archive():
    values, useful = make(ranking="fitness")[0]._judge(FITNESS, MIXED)
    np.testing.assert_array_equal(values, FITNESS)
    assert useful


def test_thresholds_rise_as_in_the_equation():
    optimizer, _ = make("cma_mae", learning_rate=0.25, threshold_min=0.1)
    added = additions([(2, AddStatus.NEW, 0.5), (2, AddStatus.NONE, 0.0), (7, AddStatus.NEW, 0.3),
                       (7, AddStatus.NONE, 0.0), (-1, AddStatus.NONE, np.nan)])  # fmt: skip
    values, useful = optimizer._judge(np.array([0.5, 0.5, 0.3, 0.05, 0.02]), added)
    # t = 0.1, then 0.75 t + 0.25 f for every f above t, one genome after the other.
    first = 0.75 * 0.1 + 0.25 * 0.5
    assert optimizer.thresholds[2] == pytest.approx(0.75 * first + 0.25 * 0.5)
    assert optimizer.thresholds[7] == pytest.approx(0.75 * 0.1 + 0.25 * 0.3)
    assert np.delete(optimizer.thresholds, [2, 7]) == pytest.approx(0.1)
    # f - t: 0.4, 0.3, 0.2, then below its threshold, then the one without a cell.
    assert order(values) == [0, 1, 2, 3, 4]
    assert useful
    assert not optimizer._judge(np.full(5, 0.05), additions([(1, AddStatus.NEW, 0.05)] * 5))[1]


def test_with_learning_rate_0_the_thresholds_stay():
    optimizer, _ = make("cma_mae", learning_rate=0.0)
    optimizer._judge(FITNESS, MIXED)
    assert not optimizer.thresholds.any()


def test_emitters_take_turns_and_only_the_one_in_turn_learns():
    optimizer, _ = make()
    for turn in range(6):
        before = [emitter.mean for emitter in optimizer._emitters]
        optimizer.ask()
        optimizer.tell(FITNESS, MIXED)
        moved = [
            bool(np.abs(emitter.mean - mean).max() > 0)
            for emitter, mean in zip(optimizer._emitters, before, strict=True)
        ]
        assert moved == [index == turn % 3 for index in range(3)]


def elites(archive, count):
    genomes = np.arange(1.0, count + 1)[:, None] * np.ones(DIMENSION)
    archive.add(genomes, np.ones(count), SPACE.triples[:count], np.zeros((count, 3, 3)))


def idle(optimizer, generations):
    for _ in range(generations):
        optimizer.ask()
        optimizer.tell(FITNESS, NOTHING)


@pytest.mark.parametrize("name", ["cma_me", "cma_mae"])
def test_an_idle_emitter_restarts_from_an_elite_after_more_turns_than_its_patience(name):
    learning = {"threshold_min": 5.0} if name == "cma_mae" else {}
    optimizer, archive = make(name, patience=4, **learning)
    elites(archive, 4)
    idle(optimizer, 3 * 4)
    assert optimizer.metrics()["restarts"] == 0.0
    assert optimizer.metrics()["longest_idle"] == 4.0
    idle(optimizer, 1)
    assert optimizer.metrics()["restarts"] == 1.0
    mean = optimizer._emitters[0].mean
    assert mean.tolist() in [[value] * DIMENSION for value in (1.0, 2.0, 3.0, 4.0)]
    assert optimizer._emitters[0].sigma == pytest.approx(0.1)
    idle(optimizer, 2)
    assert optimizer.metrics()["restarts"] == 3.0


def test_there_is_no_restart_before_there_are_more_elites_than_emitters():
    optimizer, archive = make(patience=2)
    elites(archive, 3)
    idle(optimizer, 30)
    assert optimizer.metrics()["restarts"] == 0.0


def test_an_addition_starts_the_count_again():
    optimizer, archive = make(patience=4)
    elites(archive, 4)
    idle(optimizer, 3 * 4)
    for _ in range(3):
        optimizer.ask()
        optimizer.tell(FITNESS, MIXED)
    idle(optimizer, 3 * 4)
    assert optimizer.metrics()["restarts"] == 0.0
