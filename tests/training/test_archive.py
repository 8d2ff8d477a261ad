"""Training with an archive: what it records, and that it survives being killed anywhere."""

import dataclasses
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from ncrs import evaluate
from ncrs.automaton.channels import nca_layout
from ncrs.engines.base import Engine
from ncrs.evolution.archive import AddResult
from ncrs.evolution.optimizers import OPTIMIZERS, SepCMAESSettings
from ncrs.runs.champion import load_champion_file
from ncrs.runs.checkpoint import CheckpointFolder
from ncrs.runs.elites import load_archive
from ncrs.runs.engine_settings import ConfigError, EngineSettings
from ncrs.runs.lock import RunError
from ncrs.runs.settings import TrainConfig, save_config
from ncrs.training import search
from ncrs.training.generation import Generation
from ncrs.training.trainer import Trainer, train
from ncrs_envs.mirroring import ScenarioSampling

ROOT = Path(__file__).parents[2]
GENERATIONS = 8
EMITTERS = {"population": 10, "sigma": 0.1, "emitters": 2, "patience": 1, "diagonal": True}
SETTINGS = {
    "cma_me": EMITTERS,
    "cma_mae": EMITTERS,
    "map_elites": {"population": 10, "initial_genomes": 30},
    # The full covariance of 4,572 weights: checkpoints of 84 MB, written in the background.
    "cma_es": {"population": 10, "sigma": 0.1},
}
FEWER_GENERATIONS = {"cma_es": 4}
"""Number of generations of optimizers whose checkpoints take long to write."""


def config(name="map_elites", **changes):
    return dataclasses.replace(
        TrainConfig(
            optimizer=OPTIMIZERS[name].settings(**SETTINGS[name]),
            engine=EngineSettings(name="batched", workers=1),
            symmetric=False,
            mirroring="none",
            generations=FEWER_GENERATIONS.get(name, GENERATIONS),
            episodes=2,
            champion_every=2,
            champion_episodes=2,
            reestimate_every=5,
            checkpoint_seconds=0,
            seed=3,
        ),
        **changes,
    )


def final_state(run_dir):
    state = CheckpointFolder(Path(run_dir) / "checkpoints").load()
    del state["run"]["seconds"]
    return state


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """Makes one finished run per optimizer, on demand."""
    folders = {}

    def run(name):
        if name not in folders:
            folders[name] = tmp_path_factory.mktemp(name)
            train(config(name), folders[name])
        return folders[name]

    return run


KILLED = """
import os, signal, sys
import ncrs.runs.checkpoint
from ncrs.evolution.optimizers.base import Optimizer
from ncrs.runs.settings import load_config
from ncrs.training.trainer import train
import dataclasses, io
from pathlib import Path

folder, where, calls = sys.argv[1], sys.argv[2], int(sys.argv[3])

def count_down():
    global calls
    calls -= 1
    return calls < 0

if where == "tell":  # the population was asked for and evaluated, and is not told
    real_tell = Optimizer.tell
    def tell(self, fitness, added=None):
        if count_down():
            os.kill(os.getpid(), signal.SIGKILL)
        real_tell(self, fitness, added)
    Optimizer.tell = tell
else:  # half of a checkpoint is on the disk
    real_savez = ncrs.runs.checkpoint.np.savez
    def savez(stream, **arrays):
        whole = io.BytesIO()
        real_savez(whole, **arrays)
        content = whole.getvalue()
        if "generation_" in stream.name and count_down():
            stream.write(content[: len(content) // 2])
            stream.flush()
            os.kill(os.getpid(), signal.SIGKILL)
        stream.write(content)
    ncrs.runs.checkpoint.np.savez = savez

train(dataclasses.replace(load_config(Path(folder)), resume=folder), folder)
"""


@pytest.mark.parametrize(
    ("name", "where", "calls"),
    [
        pytest.param("cma_me", "tell", 5, marks=pytest.mark.slow),
        pytest.param("cma_me", "checkpoint", 2, marks=pytest.mark.slow),
        pytest.param("cma_mae", "checkpoint", 1, marks=pytest.mark.slow),
        ("map_elites", "tell", 3),
        pytest.param("cma_es", "checkpoint", 1, marks=pytest.mark.slow),
    ],
)
def test_a_run_killed_where_it_hurts_ends_bit_equal(undisturbed, tmp_path, name, where, calls):
    train(config(name, generations=2), tmp_path)
    # As a run that was started for all generations would have stored it.
    longer = config(name)
    save_config(longer, tmp_path)
    done = subprocess.run(
        [sys.executable, "-c", KILLED, str(tmp_path), where, str(calls)],
        cwd=ROOT, capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == -9, done.stderr
    assert 2 <= final_state(tmp_path)["run"]["generation"] < longer.generations
    train(config(name, resume=str(tmp_path)), tmp_path)
    np.testing.assert_equal(final_state(tmp_path), final_state(undisturbed(name)))
    for file in ("archive.npz", "champion.npz"):
        assert (tmp_path / file).read_bytes() == (undisturbed(name) / file).read_bytes()


def test_the_archive_is_filed_with_the_run(undisturbed):
    run_dir = undisturbed("map_elites")
    elites = load_archive(run_dir)
    np.testing.assert_equal(elites.archive.state(), final_state(run_dir)["search"]["archive"])
    assert len(elites.archive) > 3
    # Re-estimated at the start of generation 5, or found since on their generation's scenarios.
    seeds, generations = elites.archive.column("seeds"), elites.archive.column("generations")
    old = generations < 5
    assert old.any()
    assert (seeds[old] == [3, 4, 5, -1]).all()
    for seed, generation in zip(seeds[~old], generations[~old], strict=True):
        np.testing.assert_array_equal(seed, [3, 1, generation, -1])


def test_the_curves_of_the_archive(undisturbed):
    run_dir = undisturbed("map_elites")
    accumulator = EventAccumulator(str(run_dir)).Reload()
    statistics = load_archive(run_dir).archive.statistics()
    for name in (*statistics, "new", "improved"):
        events = accumulator.Scalars(f"qd/{name}")
        assert events[-1].step == GENERATIONS - 1, name
        if name in statistics:
            assert events[-1].value == pytest.approx(statistics[name]), name
    filled = [event.value for event in accumulator.Scalars("qd/filled")]
    new = [event.value for event in accumulator.Scalars("qd/new")]
    np.testing.assert_array_equal(np.cumsum(new), filled)


def test_plain_cma_es_fills_an_archive_too(tmp_path):
    optimizer = SepCMAESSettings(population=16, sigma=0.1, parents=None, step_size="csa")
    train(config(optimizer=optimizer, generations=3), tmp_path)
    elites = load_archive(tmp_path)
    assert len(elites.archive) >= 3
    elite = elites.elite(elites.archive.measures[0].tolist())
    again = elite.evaluate(engine="batched")
    assert again.fitness[0] == elite.fitness


def test_scenarios_per_genome_are_kept_with_the_elite(tmp_path):
    train(config(common_scenarios=False, generations=6, reestimate_every=0), tmp_path)
    archive = load_archive(tmp_path).archive
    seeds = archive.column("seeds")
    assert (seeds[:, 3] >= 0).all()
    assert len(np.unique(archive.column("standing_still"))) > 1


def test_the_best_elite_is_a_candidate(tmp_path):
    trainer = Trainer(config(generations=4), tmp_path)
    trainer.run()
    archive = load_archive(tmp_path).archive
    genomes = archive.column("genomes")[:3].astype(np.float64)
    evaluation = evaluate(genomes, "light_chase", episodes=2, engine="batched")
    added = AddResult(np.zeros(3, int), np.zeros(3, np.int8), np.zeros(3))
    candidates = trainer._search.candidates(Generation(4, genomes, evaluation, added))
    assert list(candidates) == ["sample", "elite"]
    np.testing.assert_array_equal(candidates["sample"], genomes[evaluation.fitness.argmax()])
    np.testing.assert_array_equal(candidates["elite"], archive.best_genome())


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("name", ["sep_cma_es", "map_elites"])
def test_fitness_without_meaning_stops_the_run_and_saves(tmp_path, monkeypatch, name, value):
    real, calls = Engine.evaluate, [0]

    def broken(self, *arguments):
        result = real(self, *arguments)
        calls[0] += 1
        if calls[0] == 3:
            return dataclasses.replace(result, fitness=np.full(len(result.fitness), value))
        return result

    monkeypatch.setattr(Engine, "evaluate", broken)
    optimizer = config().optimizer
    if name != "map_elites":
        optimizer = SepCMAESSettings(population=10, sigma=0.1, parents=None, step_size="csa")
    settings = config(optimizer=optimizer, generations=4, champion_every=4)
    with pytest.raises(RunError, match=r"Generation 2.*(infinite|NaN)"):
        train(settings, tmp_path)
    assert final_state(tmp_path)["run"]["generation"] == 2
    assert np.isfinite(load_archive(tmp_path).archive.column("fitness")).all()
    result = train(dataclasses.replace(settings, resume=str(tmp_path)), tmp_path)
    assert result.state.generation == 4


def test_elites_whose_estimate_is_nan_are_dropped_and_counted(tmp_path, monkeypatch):
    real = search.reestimate

    def broken(archive, engine, *arguments):
        def evaluate_as_nan(genomes, *others):
            result = type(engine).evaluate(engine, genomes, *others)
            return dataclasses.replace(result, fitness=np.full(len(result.fitness), np.nan))

        with monkeypatch.context() as patch:
            patch.setattr(engine, "evaluate", evaluate_as_nan)
            return real(archive, engine, *arguments)

    train(config(generations=5), tmp_path / "before")
    before = len(load_archive(tmp_path / "before").archive)
    monkeypatch.setattr(search, "reestimate", broken)
    train(config(generations=7), tmp_path / "after")
    assert before > 0
    assert final_state(tmp_path / "after")["run"]["dropped"] == before
    assert len(load_archive(tmp_path / "after").archive) > 0  # and it fills up again


def test_a_run_of_another_optimizer_is_refused(undisturbed):
    run_dir = undisturbed("cma_me")
    before = final_state(run_dir)
    with pytest.raises(ConfigError, match=r"'cma_me'.*'cma_mae'"):
        train(config("cma_mae", resume=str(run_dir)), run_dir)
    np.testing.assert_equal(final_state(run_dir), before)


def test_symmetric_search_on_mirrored_scenarios(tmp_path):
    """Elites have the fitness of their evaluation, on the scenarios that they name."""
    changes = {"placement_noise": 0.3, "reestimate_every": 0}
    train(config(symmetric=True, mirroring="front_back", **changes), tmp_path)
    archive = load_archive(tmp_path)
    assert archive.sampling == ScenarioSampling("front_back", 0.3)
    layout = nca_layout("light_chase")
    for measures in archive.archive.measures[:3].tolist():
        elite = archive.elite(measures)
        genome = elite.genome[None].astype(np.float64)
        np.testing.assert_array_equal(layout.symmetric(genome), genome)
        np.testing.assert_array_equal(elite.body, elite.body[:, ::-1])
        front, back = (scenario.light for scenario in elite.scenarios)
        assert front == (back[0], -back[1])
        again = evaluate(elite.genome, "light_chase", scenarios=elite.scenarios, engine="batched")
        assert again.fitness[0] == pytest.approx(elite.fitness, abs=1e-6)
    champion = load_champion_file(tmp_path)
    weights = champion.genome[None].astype(np.float64)
    np.testing.assert_allclose(layout.symmetric(weights), weights, atol=1e-7)
