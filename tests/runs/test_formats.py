"""Runs of every released format load for ever, or are refused clearly.

A run of the present format was made with ``ncrs.train(folder, **SETTINGS[name])`` below, and the
events and the lock removed.
"""

import shutil
from pathlib import Path

import numpy as np
import pytest

import ncrs
from ncrs.runs.champion import load_champion_file
from ncrs.runs.checkpoint import FORMAT
from ncrs.runs.metrics import read_metrics
from ncrs.runs.settings import load_config

FORMATS = Path(__file__).parents[1] / "data" / "formats"
COMMON = {
    "generations": 2, "episodes": 2, "champion_every": 1, "champion_episodes": 2, "seed": 7,
    "progress": False,
}  # fmt: skip
SETTINGS = {
    "sep_cma_es": {
        **COMMON, "start_from": "light_chase/best",
        "optimizer": {"name": "sep_cma_es", "population": 6, "parents": 3, "sigma": 0.01},
    },
    "map_elites": {
        **COMMON, "task": "carry_ball", "symmetric": False, "mirroring": "none",
        "optimizer": {"name": "map_elites", "population": 6, "initial_genomes": 12},
    },
}  # fmt: skip
RUNS = sorted(path.parent for path in FORMATS.glob("*/*/config.json"))


def test_the_present_format_is_among_them():
    assert {path.name for path in (FORMATS / str(FORMAT)).iterdir()} == set(SETTINGS)


@pytest.mark.parametrize("stored", RUNS, ids=lambda path: f"{path.parent.name}-{path.name}")
def test_a_stored_run_loads_and_goes_on(stored, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(stored, folder)
    config = load_config(folder)
    assert config.optimizer.name == stored.name
    assert len(read_metrics(folder)["fitness/best"]) == config.generations
    archive = ncrs.load_archive(folder)
    if stored.name == "sep_cma_es":
        assert load_champion_file(folder).fitness > 0.3
        assert len(archive.archive) > 0
    run = ncrs.train(folder, resume=True, generations=config.generations + 1, progress=False)
    assert run.finished
    assert np.isfinite(run.curves["fitness/best"]).all()
