"""Runs on a cluster whose workers, or whose scheduler, are lost."""

import threading

import numpy as np
import pytest

pytest.importorskip("distributed", reason="needs the extra cluster")
pytest.importorskip("resource", reason="forks workers")

from ncrs.engines.base import EngineError
from ncrs.runs.checkpoint import CheckpointFolder
from ncrs.runs.metrics import read_metrics
from ncrs.runs.settings import CHANGED_ON_RESUME
from ncrs.training.api import train
from tests.engines.cluster.processes import Processes, Zygote, wait_for

pytestmark = pytest.mark.slow

GENERATIONS = 10
SETTINGS = {
    "optimizer": {"name": "map_elites", "population": 64},
    "generations": GENERATIONS,
    "episodes": 2,
    "champion_every": 4,
    "champion_episodes": 2,
    "checkpoint_seconds": 0,
    "seed": 5,
    "progress": False,
}


@pytest.fixture(scope="module")
def zygote():
    with Zygote() as made:
        yield made


@pytest.fixture
def processes(zygote, tmp_path):
    with Processes(zygote, tmp_path) as made:
        yield made


def engine_of(processes):
    return {"name": "dask", "scheduler": processes.scheduler_file}


def final_state(folder):
    """All that a run's future depends on, without times and the engine."""
    state = CheckpointFolder(folder / "checkpoints").load()
    del state["run"]["seconds"], state["settings"]
    return state


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """The final state of the same run with threads of one process."""
    folder = tmp_path_factory.mktemp("undisturbed")
    train(folder, engine="batched", **SETTINGS)
    return final_state(folder)


class Killer(threading.Thread):
    """Kills one of the workers every second, and starts another."""

    def __init__(self, processes, workers):
        super().__init__(daemon=True)
        self._processes, self._workers = processes, workers
        self._end = threading.Event()
        self._rng = np.random.default_rng(0)
        self.killed = 0

    def run(self):
        while not self._end.wait(1.0):
            self._processes.end(self._workers.pop(self._rng.integers(len(self._workers))))
            self._workers.append(self._processes.add_worker("slowness"))
            self.killed += 1

    def __enter__(self):
        self.start()
        return self

    def __exit__(self, *error):
        self._end.set()
        self.join()


@pytest.mark.parametrize("count", [1, 2])
def test_a_run_is_the_same_on_any_number_of_workers(count, processes, tmp_path, undisturbed):
    for _ in range(count):
        processes.add_worker()
    train(tmp_path / "run", engine=engine_of(processes), **SETTINGS)
    np.testing.assert_equal(final_state(tmp_path / "run"), undisturbed)


def test_and_on_four_of_which_one_is_killed_every_second(processes, tmp_path, undisturbed):
    workers = [processes.add_worker("slowness") for _ in range(4)]
    with Killer(processes, workers) as killer:
        train(tmp_path / "run", engine=engine_of(processes), **SETTINGS)
    np.testing.assert_equal(final_state(tmp_path / "run"), undisturbed)
    assert killer.killed >= 3
    counts = read_metrics(tmp_path / "run")
    assert counts["workers/lost"][-1] <= 2 * killer.killed  # two shards at each
    assert counts["workers/checked"][-1] >= 1
    assert counts["workers/differences"][-1] == 0


def test_a_run_survives_the_loss_of_all_workers_but_one(
    processes, tmp_path, undisturbed, monkeypatch, capfd
):
    monkeypatch.setenv("NCRS_QUIET", "0")
    workers = [processes.add_worker("slowness") for _ in range(4)]
    processes.wait_for_workers(4)

    def kill(generation, metrics):
        if generation.index < 3:
            processes.end(workers[generation.index])

    train(tmp_path / "run", engine=engine_of(processes), callback=kill, **SETTINGS)
    np.testing.assert_equal(final_state(tmp_path / "run"), undisturbed)
    printed = capfd.readouterr().err
    assert "ncrs: workers: 4; computers: 1; threads: 4; engine: batched" in printed
    for left in (3, 2, 1):
        assert f"left; workers: {left}" in printed


def test_a_lost_scheduler_saves_and_the_run_goes_on_with_another(
    processes, zygote, tmp_path, undisturbed
):
    processes.add_worker("slowness")

    def kill(generation, metrics):
        if generation.index == 4:
            processes.end(processes.scheduler)

    with pytest.raises(EngineError, match=r"does not answer any more; start it again"):
        train(tmp_path / "run", engine=engine_of(processes), callback=kill, **SETTINGS)
    assert CheckpointFolder(tmp_path / "run" / "checkpoints").load()["run"]["generation"] == 5
    assert "engine.scheduler" in CHANGED_ON_RESUME
    (tmp_path / "other").mkdir()
    with Processes(zygote, tmp_path / "other") as others:
        others.add_worker()
        train(tmp_path / "run", engine=engine_of(others), resume=True, progress=False)
    np.testing.assert_equal(final_state(tmp_path / "run"), undisturbed)


def test_the_command_ends_with_one_sentence(processes, tmp_path, launched):
    processes.add_worker("slowness")
    metrics = tmp_path / "run" / "metrics.csv"

    def kill():
        wait_for(lambda: metrics.exists() and metrics.read_text().count("\n") > 2)
        processes.end(processes.scheduler)

    threading.Thread(target=kill, daemon=True).start()
    ended = launched(
        "engine=dask", f"engine.scheduler={processes.scheduler_file}", "generations=100",
        "optimizer.population=32", "episodes=2", f"hydra.run.dir={tmp_path / 'run'}",
    )  # fmt: skip
    assert ended.returncode == 2
    (sentence,) = [line for line in ended.stderr.splitlines() if line.startswith("train.py: ")]
    assert "does not answer any more; start it again, with its workers, then resume" in sentence
    assert "Traceback" not in ended.stderr
