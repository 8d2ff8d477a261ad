"""The optimizer that drafts robots for every measure triple."""

import numpy as np
import pytest

import ncrs
from ncrs.drafts.controllers import CONTROLLERS, controller_genomes
from ncrs.evolution.optimizers import OPTIMIZERS, OptimizerError, make_optimizer
from ncrs.runs.elites import make_archive
from ncrs_envs.tasks import CARRY_BALL, LIGHT_CHASE, TaskSettings

SMALL = {
    "optimizer": {"name": "drafts", "population": 12}, "progress": False, "episodes": 2,
    "champion_episodes": 2,
}  # fmt: skip


def make(population=12, **settings):
    record = OPTIMIZERS["drafts"].settings(population=population, **settings)
    archive = make_archive(TaskSettings("light_chase"))
    optimizer = make_optimizer(record, archive.dimension, np.random.SeedSequence(0))
    optimizer.set_task(LIGHT_CHASE)
    optimizer.attach(archive)
    return optimizer


def test_each_body_gets_all_controllers():
    optimizer = make(10)
    genomes = optimizer.ask()
    assert genomes.shape == (10, 4572)
    growing = genomes - controller_genomes(LIGHT_CHASE)[np.arange(10) % len(CONTROLLERS)]
    np.testing.assert_allclose(growing[0], growing[3], atol=1e-3)
    assert not np.allclose(growing[3], growing[4], atol=0.1)
    bodies = ncrs.evaluate(genomes, "light_chase", episodes=1).bodies
    np.testing.assert_array_equal(bodies[0], bodies[3])


def test_an_archive_is_filled_and_goes_on_where_it_was_stopped(tmp_path):
    whole = ncrs.train(tmp_path / "whole", generations=2, **SMALL)
    archive = ncrs.load_archive(whole.run_dir).archive
    assert 4 <= len(archive) <= 6
    assert archive.column("fitness").max() > 0.43  # more than standing still
    ncrs.train(tmp_path / "half", generations=1, **SMALL)
    half = ncrs.train(tmp_path / "half", resume=tmp_path / "half", generations=2)
    resumed = ncrs.load_archive(half.run_dir).archive
    for name in ("genomes", "fitness", "bodies"):
        np.testing.assert_array_equal(archive.column(name), resumed.column(name))


def test_empty_triples_come_first():
    optimizer = make()
    archive = optimizer._archive
    empty = np.arange(7, 2300, 100)
    filled = np.setdiff1d(np.arange(2300), empty)
    archive._fill(filled)
    wanted = {tuple(triple) for triple in archive.space.triples[empty].tolist()}
    drawn = [tuple(triple) for triple in optimizer._triples(20)]
    assert len(wanted.intersection(drawn[:10])) == 10


def test_what_cannot_work_is_refused():
    record = OPTIMIZERS["drafts"].settings()
    optimizer = make_optimizer(record, 4572, np.random.SeedSequence(0))
    with pytest.raises(OptimizerError, match=r"4873 weights, .* 4572"):
        optimizer.set_task(CARRY_BALL)
    with pytest.raises(OptimizerError, match="set_task"):
        optimizer.ask()
    with pytest.raises(OptimizerError, match="descent_steps must be at least 1"):
        OPTIMIZERS["drafts"].settings(descent_steps=0)
