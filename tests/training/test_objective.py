"""Starts and objectives of a search."""

import dataclasses

import numpy as np
import pytest

from ncrs.evolution.optimizers import CMAMESettings, MAPElitesSettings, SepCMAESSettings
from ncrs.evolution.optimizers.base import Optimizer
from ncrs.runs.champion import Champion, load_champion_file
from ncrs.runs.checkpoint import CheckpointFolder
from ncrs.runs.elites import load_archive
from ncrs.runs.engine_settings import ConfigError, EngineSettings
from ncrs.runs.settings import TrainConfig
from ncrs.training.trainer import Trainer, train
from ncrs_envs.tasks import LIGHT_CHASE, TaskSettings, default_body


def config(**changes):
    settings = {
        "optimizer": SepCMAESSettings(sigma=1e-4, population=16, parents=None, step_size="csa"),
        "engine": EngineSettings(name="batched", workers=1),
        "symmetric": False,
        "mirroring": "none",
        "generations": 2,
        "episodes": 4,
        "champion_every": 1,
        "champion_episodes": 4,
        **changes,
    }
    return TrainConfig(**settings)


@pytest.fixture
def seed_file(tmp_path, full_genome):
    path = tmp_path / "seed.npz"
    body = default_body(LIGHT_CHASE, 5)
    Champion(full_genome, body, TaskSettings(), 0.4, 0.0, 0, "mean").save(path)
    return path


@pytest.mark.parametrize("name", ["sep_cma_es", "cma_me"])
def test_a_search_starts_from_a_champion(name, seed_file, tmp_path, full_genome):
    optimizer = SepCMAESSettings(sigma=1e-5, population=16, parents=None, step_size="csa")
    if name == "cma_me":
        optimizer = CMAMESettings(sigma=1e-5, population=16, diagonal=True, emitters=2)
    run = tmp_path / "run"
    settings = config(optimizer=optimizer, start_from=str(seed_file))
    train(settings, run)
    found = load_champion_file(run).genome
    # A coordinate of the search moves by a few sigma.
    assert 0.0 < np.abs(found - full_genome).max() < 1e-4
    state = CheckpointFolder(run / "checkpoints").load()
    assert state["search"]["optimizer"]["restarts"] == 0


def test_a_start_that_does_not_fit_is_refused(seed_file, tmp_path):
    with pytest.raises(ConfigError, match="map_elites cannot start from a genome"):
        Trainer(
            config(optimizer=MAPElitesSettings(), start_from=str(seed_file)),
            tmp_path / "run",
        )
    with pytest.raises(ConfigError, match="does not treat left and right alike"):
        Trainer(config(symmetric=True, start_from=str(seed_file)), tmp_path / "run")
    with pytest.raises(ConfigError, match="does not exist"):
        Trainer(config(start_from=str(tmp_path / "nothing")), tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_the_optimizer_is_told_the_bonus_and_the_archive_the_fitness(
    seed_file, tmp_path, monkeypatch
):
    told = []
    real = Optimizer.tell
    monkeypatch.setattr(
        Optimizer, "tell", lambda self, values, added: (told.append(values), real(self, values))
    )
    settings = config(start_from=str(seed_file), approach_bonus=3.0, generations=1)
    train(settings, tmp_path / "run")
    champion = load_champion_file(tmp_path / "run")
    assert 0.3 < champion.fitness < 0.5
    # The closest score of a robot is at least its mean score.
    assert (told[0] >= 4 * 0.3).all()
    state = CheckpointFolder(tmp_path / "run" / "checkpoints").load()
    assert state["selection"]["objective"] >= 4 * champion.fitness
    assert state["run"]["best_fitness"] < 0.6


def test_resuming_goes_on_from_the_state_and_not_from_the_start(seed_file, tmp_path):
    settings = config(start_from=str(seed_file))
    train(settings, tmp_path / "run")
    before = load_champion_file(tmp_path / "run")
    seed_file.unlink()
    folder = CheckpointFolder(tmp_path / "run" / "checkpoints")
    state = folder.load()
    assert state["selection"]["objective"] == before.fitness
    longer = dataclasses.replace(settings, generations=3, resume=str(tmp_path / "run"))
    train(longer, tmp_path / "run")
    assert load_champion_file(tmp_path / "run").fitness >= before.fitness
    assert folder.load()["run"]["generation"] == 3


def test_an_elite_of_a_curriculum_has_its_fitness_in_its_scenarios(tmp_path):
    optimizer = SepCMAESSettings(sigma=0.02, population=16, parents=None)
    eased = config(
        optimizer=optimizer, start_from="light_chase/best", curriculum="nearer",
        curriculum_generations=4, objective="soft_success", generations=3,
    )  # fmt: skip
    train(eased, tmp_path / "eased")
    plain = dataclasses.replace(eased, curriculum="none")
    train(plain, tmp_path / "plain")
    archives = [load_archive(tmp_path / name) for name in ("eased", "plain")]
    assert archives[0].sampling.curriculum_generations == 4
    assert archives[1].sampling == plain.sampling()
    best = [archive.archive.statistics()["best"] for archive in archives]
    assert best[0] > best[1] + 0.02  # the light is nearer
    for archive in archives:
        elite = archive.elite(archive.archive.measures[0])
        assert elite.evaluate("batched").fitness[0] == elite.fitness
