"""Sweeps: skipped, resumed and failed jobs, and sweeps that are killed and started again."""

import importlib.util
import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from ncrs.runs.champion import load_champion_file
from ncrs.runs.checkpoint import generations_done
from ncrs.training.hydra import job_name

ROOT = Path(__file__).parents[2]
TINY = [
    "optimizer.population=8", "generations=4", "episodes=2", "champion_every=2",
    "champion_episodes=2", "checkpoint_seconds=0", "start_from=light_chase/best",
    "optimizer.sigma=0.01", "engine.workers=1",
]  # fmt: skip
GRID = ["seed=0,1,2", "task=light_chase,obstacle"]
WAYS = {
    "basic": GRID,
    "joblib": [*GRID, "hydra/launcher=ncrs_joblib"],
    "submitit": [*GRID, "hydra/launcher=ncrs_local"],
    "optuna": ["optimizer.sigma=interval(0.005,0.02)", "hydra/sweeper=ncrs_optuna",
               "hydra.sweeper.n_trials=6"],
}  # fmt: skip
PACKAGES = {
    "basic": "hydra",
    "joblib": "hydra_plugins.hydra_joblib_launcher",
    "submitit": "hydra_plugins.hydra_submitit_launcher",
    "optuna": "hydra_plugins.hydra_optuna_sweeper",
}


def command(folder, *arguments):
    return [sys.executable, "train.py", "-m", f"hydra.sweep.dir={folder}", *arguments]


def sweep(folder, *arguments):
    return subprocess.run(
        command(folder, *arguments), cwd=ROOT, capture_output=True, text=True, timeout=280
    )


def table(folder):
    """Everything that the sweep's table says."""
    return json.loads((folder / "results.json").read_text())


@pytest.mark.slow
def test_a_sweep_goes_on_after_failures_and_skips_what_has_finished(launched, tmp_path):
    def again_in(folder, *arguments):
        return launched("-m", f"hydra.sweep.dir={folder}", *arguments)

    first = again_in(tmp_path, *TINY, "seed=0,1", "optimizer.parents=4,9")
    assert first.returncode == 1, first.stdout + first.stderr
    assert "one job will be refused: population 8 is smaller than the 9" in first.stderr
    assert "Traceback" not in first.stderr
    assert f"-m {' '.join(TINY)} seed=0,1 optimizer.parents=4,9 hydra.sweep.dir=" in first.stdout
    assert {run["run"]: run["status"] for run in table(tmp_path)["runs"]} == {
        "optimizer.parents=4,seed=0": "finished",
        "optimizer.parents=4,seed=1": "finished",
        "optimizer.parents=9,seed=0": "failed",
        "optimizer.parents=9,seed=1": "failed",
    }
    assert "smaller than the 9 parents" in (tmp_path / "results.md").read_text()

    kept = {path: path.read_bytes() for path in tmp_path.glob("*parents=4*/**/*.[yn]*")}
    assert {path.name for path in kept} >= {"overrides.yaml", "champion.npz"}
    again = again_in(tmp_path, *TINY, "seed=0,1", "optimizer.parents=4,5")
    assert again.returncode == 0, again.stdout + again.stderr
    assert again.stdout.count("Finished before: ") == 2
    assert {path: path.read_bytes() for path in kept} == kept
    assert len(table(tmp_path)["runs"]) == 4
    assert "failed" not in (tmp_path / "results.csv").read_text()

    other = again_in(tmp_path, *TINY, "seed=0,1", "optimizer.parents=4,5", "episodes=4")
    assert other.returncode == 1
    assert other.stderr.count("its episodes is 2, 4 was given") == 4
    assert other.stderr.count("Use another hydra.sweep.dir.") == 4
    assert {path: path.read_bytes() for path in kept} == kept
    assert {run["status"] for run in table(tmp_path)["runs"]} == {"finished"}
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "failed.json").write_text("{}")
    (tmp_path / "notes" / "thesis.txt").write_text("mine")
    last = again_in(tmp_path, *TINY, "seed=0,1", "optimizer.parents=4")
    assert (tmp_path / "notes" / "thesis.txt").read_text() == "mine"
    assert last.returncode == 1  # that folder counts as a failed job


def test_jobs_are_named_by_what_was_swept():
    assert job_name("optimizer.sigma=0.1,seed=3", 0) == "optimizer.sigma=0.1,seed=3"
    assert job_name("", 7) == "7"
    named = job_name("experiment=best/light_chase,seed=0", 0)
    assert named.startswith("experiment=best_light_chase,seed=0-")
    assert job_name("experiment=best_light_chase,seed=0", 0) != named
    assert len(job_name("seed=1," * 100, 0)) < 200


@pytest.fixture(params=[pytest.param(way, marks=pytest.mark.slow) for way in WAYS])
def way(request):
    if importlib.util.find_spec(PACKAGES[request.param]) is None:
        pytest.skip(f"{PACKAGES[request.param]} is not installed")
    return WAYS[request.param]


def _kill_at(folder, arguments, generations):
    """Start a sweep and kill all its processes when its runs have done that many generations."""
    process = subprocess.Popen(
        command(folder, *arguments), cwd=ROOT, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    deadline = time.monotonic() + 250
    while sum(map(generations_done, folder.glob("*/checkpoints"))) < generations:
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.005)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def test_a_sweep_killed_twice_ends_with_the_table_of_an_undisturbed_one(way, tmp_path):
    arguments = [*TINY, "optimizer.parents=4", *way]
    undisturbed = sweep(tmp_path / "undisturbed", *arguments)
    assert undisturbed.returncode == 0, undisturbed.stdout + undisturbed.stderr
    expected = table(tmp_path / "undisturbed")
    assert len(expected["runs"]) == 6
    assert all(run["status"] == "finished" for run in expected["runs"])

    killed = tmp_path / "killed"
    _kill_at(killed, arguments, 6)
    assert 0 < sum(map(generations_done, killed.glob("*/checkpoints"))) < 24
    _kill_at(killed, arguments, 15)
    assert sum(map(generations_done, killed.glob("*/checkpoints"))) < 24
    last = sweep(killed, *arguments)
    assert last.returncode == 0, last.stdout + last.stderr
    assert table(killed) == expected
    for champion in (tmp_path / "undisturbed").glob("*/champion.npz"):
        other = killed / champion.parent.name / "champion.npz"
        assert other.read_bytes() == champion.read_bytes()


@pytest.mark.slow
def test_optuna_maximises_and_goes_on_after_its_study(tmp_path):
    optuna = pytest.importorskip("optuna")
    arguments = [*TINY, "optimizer.parents=4", *WAYS["optuna"]]
    assert sweep(tmp_path, *arguments).returncode == 0
    assert sweep(tmp_path, *arguments, "hydra.sweeper.n_trials=8").returncode == 0
    study = optuna.load_study("ncrs", f"sqlite:///{tmp_path}/study.db")
    assert study.direction.name == "MAXIMIZE"
    assert [trial.state.name for trial in study.trials] == ["COMPLETE"] * 8
    fitness = [load_champion_file(path.parent).fitness for path in tmp_path.glob("*/champion.npz")]
    assert sorted(trial.value for trial in study.trials) == sorted(fitness)
    assert math.isclose(study.best_value, max(fitness))


def _submitted(folder):
    """Find the process of a job that submitit runs."""
    for process in Path("/proc").glob("[0-9]*"):
        try:
            words = (process / "cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        if b"submitit.core._submit" in words and any(str(folder).encode() in w for w in words):
            return int(process.name)
    raise AssertionError("no job is running")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="looks for processes in /proc")
def test_a_job_whose_time_ends_is_saved_queued_again_and_resumed(tmp_path):
    pytest.importorskip("submitit")
    arguments = [*TINY, "optimizer.parents=4", "seed=0", "generations=60"]
    arguments = [word for word in arguments if word != "generations=4"]
    assert sweep(tmp_path / "undisturbed", *arguments).returncode == 0
    process = subprocess.Popen(
        command(tmp_path / "queued", *arguments, "hydra/launcher=ncrs_local"), cwd=ROOT
    )
    run = tmp_path / "queued" / "0"
    while generations_done(run / "checkpoints") < 5:
        assert process.poll() is None
        time.sleep(0.01)
    os.kill(_submitted(tmp_path / "queued"), signal.SIGUSR2)  # as SLURM does before the limit
    assert process.wait(timeout=120) == 0
    log = "".join(file.read_text() for file in tmp_path.glob("queued/.submitit/*/*log.*"))
    assert "Stopped by SIGUSR2" in log
    assert "Requeued job" in log
    champions = [tmp_path / name / "0" / "champion.npz" for name in ("queued", "undisturbed")]
    assert champions[0].read_bytes() == champions[1].read_bytes()
