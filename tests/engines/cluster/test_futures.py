"""Any executor: pools of processes, which may break, and MPI."""

import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from ncrs.engines.base import EngineError, EngineSettingError, make_engine
from ncrs.engines.cluster import station
from ncrs.engines.cluster.futures import FuturesEngine
from tests.engines.cluster.conftest import SCENARIOS, SETTINGS

ROOT = Path(__file__).parents[3]


@pytest.fixture
def population(genomes):
    return genomes(40)


def forked_pool(max_workers):
    """A pool that starts at once, since its processes inherit what was imported."""
    return ProcessPoolExecutor(max_workers, mp_context=multiprocessing.get_context("fork"))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no process can be forked here")
def test_a_pool_that_lost_a_worker_is_made_again(population, check):
    with FuturesEngine(SETTINGS, 2, forked_pool) as engine:
        check(engine.evaluate(population, SCENARIOS))
        victim = next(iter(engine.crew._executor._processes))
        os.kill(victim, signal.SIGKILL)
        check(engine.evaluate(population, SCENARIOS))
        check(engine.evaluate(population, SCENARIOS))
        assert engine.metrics()["workers/checked"] >= 1


@pytest.mark.slow
def test_a_pool_that_is_always_broken_is_an_error(population, monkeypatch):
    def die(shard):
        os._exit(1)

    monkeypatch.setattr(station, "describe_worker", die)
    with (
        FuturesEngine(SETTINGS, 2, forked_pool) as engine,
        pytest.raises(EngineError, match="11 workers were lost while evaluating genome"),
    ):
        engine.evaluate(population, SCENARIOS)


def test_executors_are_named_by_module_and_attribute(population, check):
    with make_engine(
        "futures", SETTINGS, 3, executor="concurrent.futures:ThreadPoolExecutor", threads=2
    ) as engine:
        check(engine.evaluate(population, SCENARIOS))
        assert isinstance(engine.crew._executor, ThreadPoolExecutor)
        assert [seat.threads for seat in engine.crew.seats()] == [2, 2, 2]


def test_workers_of_another_version_are_refused(population, monkeypatch):
    with FuturesEngine(SETTINGS, 2, ThreadPoolExecutor) as engine:
        monkeypatch.setattr(station, "own_versions", lambda: {"ncrs": "0.0.1"})
        with pytest.raises(EngineSettingError, match=r"has ncrs 0\.0\.1 \(here .*numba None"):
            engine.evaluate(population, SCENARIOS)


@pytest.mark.slow
def test_new_interpreters_are_the_default(population, check):
    with make_engine("futures", SETTINGS, 2) as engine:
        check(engine.evaluate(population, SCENARIOS))


MPI_SCRIPT = """
import sys

import numpy as np

from ncrs.engines.base import make_engine
from ncrs_envs.scenario import sample_scenarios
from ncrs_envs.tasks import TaskSettings

if __name__ == "__main__":
    genomes = np.load(sys.argv[1])
    executor = "mpi4py.futures:MPIPoolExecutor"
    with make_engine("futures", TaskSettings("light_chase"), executor=executor) as engine:
        result = engine.evaluate(genomes, sample_scenarios("light_chase", 0, 2))
        assert len(engine.crew.seats()) == 2
    np.save(sys.argv[2], result.episode_fitness)
"""


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("mpirun") is None, reason="needs mpirun (Debian: openmpi-bin)")
def test_workers_of_mpi(population, tmp_path):
    pytest.importorskip("mpi4py", reason="needs mpi4py")
    (tmp_path / "script.py").write_text(MPI_SCRIPT)
    np.save(tmp_path / "genomes.npy", population)
    path = os.pathsep.join([str(ROOT), *filter(None, sys.path)])
    root = dict.fromkeys(("OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM"), "1")
    done = subprocess.run(
        [
            *("mpirun", "--oversubscribe", "-n", "3"),
            *(sys.executable, "-m", "mpi4py.futures", "script.py", "genomes.npy", "fitness.npy"),
        ],
        cwd=tmp_path, env={**os.environ, **root, "PYTHONPATH": path},
        capture_output=True, text=True, timeout=250,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    with make_engine("batched", SETTINGS) as engine:
        expected = engine.evaluate(population, SCENARIOS).episode_fitness
    np.testing.assert_array_equal(np.load(tmp_path / "fitness.npy"), expected)
