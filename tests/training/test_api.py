"""Training from Python: settings, callbacks, resuming, and what it returns."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import ncrs
from ncrs.runs.checkpoint import CheckpointFolder
from ncrs.runs.engine_settings import ConfigError
from ncrs.runs.lock import RunError
from ncrs.runs.settings import TrainConfig, load_config
from ncrs_envs.tasks import TaskSettings

TINY = {
    "optimizer": {"name": "sep_cma_es", "population": 16, "sigma": 0.01},
    "episodes": 2,
    "champion_every": 2,
    "champion_episodes": 2,
    "start_from": "light_chase/best",
    "progress": False,
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    seen = []

    def callback(generation, metrics):
        seen.append((generation.index, generation.genomes.shape, metrics["fitness/best"]))

    folder = tmp_path_factory.mktemp("whole")
    return ncrs.train(folder, generations=4, seed=2, callback=callback, **TINY), seen


def test_it_returns_champion_archive_and_curves(whole):
    run, seen = whole
    assert run.finished
    assert run.champion.task == TaskSettings("light_chase")
    assert len(run.archive.archive) > 0
    assert run.curves["fitness/best"].shape == (4,)
    assert seen == [(i, (16, 4572), run.curves["fitness/best"][i]) for i in range(4)]
    assert load_config(run.run_dir) == run.config


def test_the_defaults_are_the_commands(whole):
    run, _ = whole
    names = {"optimizer", "episodes", "champion_every", "champion_episodes", "start_from"}
    defaults = TrainConfig().resolved()
    for item in dataclasses.fields(TrainConfig):
        if item.name not in names | {"generations", "seed"}:
            assert getattr(run.config, item.name) == getattr(defaults, item.name), item.name


def test_a_callback_stops_and_the_run_goes_on_exactly(whole, tmp_path):
    stopped = ncrs.train(
        tmp_path,
        generations=4,
        seed=2,
        callback=lambda generation, _: generation.index == 1,
        **TINY,
    )
    assert not stopped.finished
    assert len(stopped.curves["fitness/best"]) == 2
    with pytest.raises(RunError, match="already holds a run"):
        ncrs.train(tmp_path, generations=4, seed=2, **TINY)
    with pytest.raises(ConfigError, match="its seed is 2, 3 was given"):
        ncrs.train(tmp_path, resume=True, seed=3, progress=False)
    resumed = ncrs.train(tmp_path, resume=True, progress=False)
    assert resumed.finished
    states = []
    for folder in (tmp_path, whole[0].run_dir):
        state = CheckpointFolder(Path(folder) / "checkpoints").load()
        del state["run"]["seconds"]
        states.append(state)
    np.testing.assert_equal(*states)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"sede": 1}, "Unknown setting 'sede'. Did you mean seed"),
        ({"optimizer": "adam"}, "Unknown optimizer 'adam'; choose one of .*sep_cma_es"),
        ({"optimizer": {"sigmas": 1}}, "Unknown setting 'optimizer.sigmas'"),
        ({"task": 3}, "task must be a name, a mapping or a record, got 3"),
        ({"generations": 0}, "generations must be at least 1"),
    ],
)
def test_bad_settings_are_refused_before_anything_is_written(settings, message, tmp_path):
    with pytest.raises(ConfigError, match=message):
        ncrs.train(tmp_path / "run", **settings)
    assert not (tmp_path / "run").exists()
