"""Worker processes: none orphaned, a lost one named."""

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from ncrs.engines.base import EngineError, EvaluationInterrupted
from ncrs.engines.box2d import Box2DEngine
from ncrs.engines.pool import WorkerPool, WorkerWarning, _Map
from ncrs_envs.scenario import sample_scenarios
from ncrs_envs.tasks import TaskSettings
from tests.engines.stopping import stop_always, stop_once


def never():
    return False


def wait_until(condition, seconds=20.0):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited too long"
        time.sleep(0.02)


def alive(pid):
    """True if a process runs; one that has ended but was not waited for does not."""
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.fixture
def pool():
    pool = WorkerPool(2)
    yield pool
    pool.close()


def test_results_come_in_the_order_of_the_arguments(pool):
    results = pool.map(abs, [-3, 2, -1, 0, -5], list("abcde"), never)
    assert results == [3, 2, 1, 0, 5]
    assert len(pool.pids) == 2


def test_a_job_that_raises_is_named_and_the_pool_can_be_used_again(pool):
    with pytest.raises(EngineError, match="genome 1") as caught:
        pool.map(len, ["ab", 3, "c"], ["genome 0", "genome 1", "genome 2"], never)
    assert isinstance(caught.value.__cause__, TypeError)
    assert pool.map(len, ["abc"], ["genome 0"], never) == [3]


def test_a_killed_worker_is_an_error_that_names_the_job(pool):
    pool.map(abs, [1, 2], ["a", "b"], never)
    victim = pool.pids[0]
    timer = threading.Timer(0.5, os.kill, (victim, signal.SIGKILL))
    timer.start()
    with pytest.raises(EngineError, match=rf"{victim} was killed by SIGKILL while evaluating job"):
        pool.map(time.sleep, [20, 20], ["job 0", "job 1"], never)
    assert pool.pids == []


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="no process can be stopped here")
def test_a_stopped_worker_is_replaced_and_its_job_done_again(pool, tmp_path):
    before = pool.map(abs, [1, 2], ["a", "b"], never) and pool.pids
    with pytest.warns(WorkerWarning, match="did not answer for 4 s while evaluating genome 0"):
        results = pool.map(stop_once, [tmp_path / "once"], ["genome 0"], never, limit_s=4)
    assert results == [7]
    assert len(set(before) & set(pool.pids)) == 1
    assert pool.map(abs, [-1, -2, -3], list("abc"), never) == [1, 2, 3]


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="no process can be stopped here")
def test_a_job_that_stops_two_workers_is_an_error_that_names_it(pool):
    with (
        pytest.warns(WorkerWarning),
        pytest.raises(EngineError, match="second to try, did not answer in time while evaluating"),
    ):
        pool.map(stop_always, [None], ["genome 5"], never, limit_s=4)
    assert pool.pids == []


def test_jobs_may_take_far_longer_than_those_before_them():
    jobs = _Map(abs, [], limit_s=1000.0)
    assert jobs.limit_s == 1000.0
    jobs._longest = 0.1
    assert jobs.limit_s == 30.0
    jobs._longest = 5.0
    assert jobs.limit_s == 150.0
    jobs._longest = 50.0
    assert jobs.limit_s == 1000.0
    assert _Map(abs, [], limit_s=None).limit_s == float("inf")


def test_time_in_which_this_process_was_stopped_does_not_count(pool, monkeypatch):
    pool.map(abs, [1], ["a"], never)
    worker = pool._workers[0]
    worker.waited = 0.0
    jobs = _Map(abs, [], limit_s=2.0)
    clock = iter([0.0, 3600.0])
    polls = []

    def poll():
        polls.append(True)
        if len(polls) == 2:
            jobs._done.put((0, True, None))
        return False

    monkeypatch.setattr("ncrs.engines.pool.monotonic", lambda: next(clock))
    jobs.next(pool._workers, poll)
    assert worker.waited == 1.0
    assert not worker.is_late


def test_stopping_ends_the_workers_at_once(pool):
    pool.map(abs, [1, 2], ["a", "b"], never)
    pids = pool.pids
    start = time.monotonic()
    with pytest.raises(EvaluationInterrupted):
        pool.map(time.sleep, [20, 20], ["a", "b"], lambda: time.monotonic() - start > 0.3)
    wait_until(lambda: not any(alive(pid) for pid in pids))
    assert time.monotonic() - start < 15


def test_printing_in_a_worker_does_not_disturb_the_replies(pool, capfd):
    assert pool.map(print, ["hello", "there"], ["a", "b"], never) == [None, None]


def test_workers_use_one_thread(pool, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "2")  # of this process
    assert pool.map(os.getenv, ["OMP_NUM_THREADS"], ["a"], never) == ["1"]


@pytest.mark.skipif(not os.path.exists("/proc"), reason="looks at processes in /proc")
def test_workers_do_not_outlive_a_killed_parent():
    script = (
        "import time\n"
        "from ncrs.engines.pool import WorkerPool\n"
        "pool = WorkerPool(2)\n"
        "pool.map(abs, [1, 2], ['a', 'b'], lambda: False)\n"
        "print(*pool.pids, flush=True)\n"
        "time.sleep(60)\n"
    )
    parent = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    pids = [int(word) for word in parent.stdout.readline().split()]
    assert len(pids) == 2
    assert all(alive(pid) for pid in pids)
    parent.kill()
    parent.wait()
    parent.stdout.close()
    wait_until(lambda: not any(alive(pid) for pid in pids))


def test_the_engine_names_the_genome_of_a_killed_worker(full_genome):
    vectors = np.stack([full_genome] * 40)
    scenarios = sample_scenarios("light_chase", 0, 12)
    with Box2DEngine(TaskSettings("light_chase"), workers=2) as engine:
        engine.evaluate(vectors[:2], scenarios[:1])
        victim = engine.worker_pids[1]
        threading.Timer(0.3, os.kill, (victim, signal.SIGKILL)).start()
        with pytest.raises(EngineError, match=r"killed by SIGKILL while evaluating genome \d+"):
            engine.evaluate(vectors, scenarios)
        # A new evaluation starts new workers.
        assert np.isfinite(engine.evaluate(vectors[:2], scenarios[:1]).fitness).all()


@pytest.mark.slow
def test_a_script_without_a_main_guard_can_use_workers(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import numpy as np, ncrs\n"
        "genomes = np.zeros((2, 4572))\n"
        "result = ncrs.evaluate(genomes, 'light_chase', engine='box2d', workers=2)\n"
        "print(result.fitness)\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[0. 0.]"
