"""The optimizers that fill an archive: their common duties, and their performance.

All tests use ``measure_problem``, where the best fitness of every measure triple is known, so
that no elite can flatter itself. At equal evaluations (600 generations of 20) CMA-ES, which follows
fitness to the one peak, fills about 75 of the 560 triples with QD-score 0.10; CMA-ME with
improvement ranking fills about 550 with 0.56, where perfect elites everywhere would give 0.61.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from ncrs.evolution.archive import Archive, MeasureSpace
from ncrs.evolution.optimizers import OPTIMIZERS, OptimizerError, make_optimizer
from ncrs.runs.checkpoint import read_state, write_state

_SPEC = importlib.util.spec_from_file_location(
    "measure_problem", Path(__file__).with_name("measure_problem.py")
)
problem = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(problem)

FULL = {"sigma": 0.1, "population": 20, "linear_algebra": "pycma"}
EMITTERS = {**FULL, "emitters": 4, "patience": 3, "diagonal": False}
DIAGONAL = {"sigma": 0.1, "population": 20, "emitters": 4, "patience": 3, "diagonal": True}
VARIANTS = {
    "cma_me": ("cma_me", EMITTERS),
    "cma_me fitness": ("cma_me", {**EMITTERS, "ranking": "fitness"}),
    "cma_me diagonal": ("cma_me", {**DIAGONAL, "parents": 5, "step_size": "tpa"}),
    "cma_me torch": ("cma_me", {**EMITTERS, "linear_algebra": "torch"}),
    "cma_mae": ("cma_mae", {**EMITTERS, "learning_rate": 0.1}),
    "cma_mae diagonal": ("cma_mae", DIAGONAL),
    "map_elites": ("map_elites", {"population": 20, "initial_genomes": 60}),
}


def make_named(name, seed, **settings):
    record = OPTIMIZERS[name].settings(**settings)
    return make_optimizer(record, problem.DIMENSION, np.random.SeedSequence(seed))


def make(variant, seed=3, **changes):
    name, settings = VARIANTS[variant]
    optimizer = make_named(name, seed, **{**settings, **changes})
    archive = problem.make_archive()
    optimizer.attach(archive)
    return optimizer, archive


def fill(name, generations, seed=0, **settings):
    optimizer = make_named(name, seed, **settings)
    archive = problem.make_archive()
    optimizer.attach(archive)
    problem.advance(optimizer, archive, generations)
    return archive


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_cma_me_fills_more_at_a_higher_qd_score_than_cma_es_at_equal_evaluations(seed):
    plain = fill("cma_es", 600, seed, **FULL).statistics()
    diverse = fill("cma_me", 600, seed, **{**FULL, "emitters": 4}).statistics()
    assert plain["best"] > 0.95  # CMA-ES does its own job
    assert diverse["filled"] > 4 * plain["filled"]
    assert diverse["qd_score"] > 4 * plain["qd_score"]
    perfect = problem.best_fitness(problem.SPACE.triples).mean()
    assert 0.8 * perfect < diverse["qd_score"] < perfect


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_one_fills_the_archive_and_no_elite_beats_the_optimum(variant):
    optimizer, archive = make(variant)
    problem.advance(optimizer, archive, 150)
    least = 40 if variant == "cma_me fitness" else 120
    assert len(archive) > least
    assert (archive.column("fitness") <= problem.best_fitness(archive.measures)).all()
    assert all(np.isfinite(value) for value in optimizer.metrics().values())


@pytest.mark.parametrize("pending", [False, True])
@pytest.mark.parametrize("variant", VARIANTS)
def test_a_saved_state_goes_on_bit_for_bit(variant, pending, tmp_path):
    optimizer, archive = make(variant)
    problem.advance(optimizer, archive, 50)
    asked = optimizer.ask() if pending else None
    state = {"optimizer": optimizer.state(), "archive": archive.state()}
    write_state(tmp_path / "state.npz", state)
    if asked is not None:
        problem.judge(optimizer, archive, asked)
    saved = read_state(tmp_path / "state.npz")
    resumed, its_archive = make(variant, seed=8)
    resumed.load_state(saved["optimizer"])
    its_archive.load_state(saved["archive"])
    problem.advance(optimizer, archive, 40 - pending)
    problem.advance(resumed, its_archive, 40)
    np.testing.assert_array_equal(optimizer.ask(), resumed.ask())
    np.testing.assert_array_equal(archive.column("genomes"), its_archive.column("genomes"))
    np.testing.assert_array_equal(archive.cells, its_archive.cells)
    assert optimizer.metrics() == resumed.metrics()


@pytest.mark.parametrize("variant", ["cma_me", "cma_mae", "map_elites"])
def test_one_seed_one_run(variant):
    genomes = []
    for seed in (1, 1, 2):
        optimizer, archive = make(variant, seed)
        problem.advance(optimizer, archive, 8)
        genomes.append(optimizer.ask())
    np.testing.assert_array_equal(genomes[0], genomes[1])
    assert np.abs(genomes[0] - genomes[2]).max() > 0


@pytest.mark.parametrize("variant", ["cma_me", "cma_mae", "map_elites"])
def test_the_candidate_is_the_best_elite(variant):
    optimizer, archive = make(variant)
    assert optimizer.candidate_source == "elite"
    np.testing.assert_array_equal(optimizer.mean, np.zeros(problem.DIMENSION))
    problem.advance(optimizer, archive, 30)
    best = problem.fitness(optimizer.mean[None])[0]
    assert best == pytest.approx(archive.statistics()["best"], rel=1e-5)  # float32 genomes


@pytest.mark.parametrize("variant", ["cma_me", "cma_mae", "map_elites"])
def test_misuse_is_refused_and_changes_nothing(variant):
    optimizer, archive = make(variant)
    twin, its_archive = make(variant)
    with pytest.raises(OptimizerError, match="before ask"):
        optimizer.tell(np.zeros(20))
    genomes = optimizer.ask()
    twin.ask()
    added = archive.add(
        genomes, problem.fitness(genomes), problem.measures(genomes), np.zeros((20, 4, 4))
    )
    with pytest.raises(OptimizerError, match=r"Archive\.add.*got None"):
        optimizer.tell(np.zeros(20))
    with pytest.raises(OptimizerError, match="19 genomes told, got 20 genomes"):
        optimizer.tell(np.zeros(19), added)
    with pytest.raises(OptimizerError, match="All 20"):
        optimizer.tell(np.full(20, np.nan), added)
    optimizer.tell(problem.fitness(genomes), added)
    problem.judge(twin, its_archive, genomes)
    np.testing.assert_array_equal(optimizer.ask(), twin.ask())
    with pytest.raises(OptimizerError, match="5 weights, this optimizer's 12"):
        optimizer.attach(Archive(MeasureSpace(1, 2, 16), 5, grid_size=4))
    name, settings = VARIANTS[variant]
    alone = make_named(name, 0, **settings)
    with pytest.raises(OptimizerError, match="attach"):
        _ = alone.mean


def test_a_state_of_another_optimizer_or_setting_is_refused():
    state = make("cma_me")[0].state()
    for variant, changes, message in [
        ("cma_mae", {}, "optimizer is 'cma_me', this optimizer's is 'cma_mae'"),
        ("map_elites", {}, "'cma_me'.*'map_elites'"),
        ("cma_me", {"emitters": 5}, "'emitters': 4.*'emitters': 5"),
        ("cma_me fitness", {}, "'ranking': 'improvement'.*'ranking': 'fitness'"),
    ]:
        with pytest.raises(OptimizerError, match=message):
            make(variant, **changes)[0].load_state(state)
