"""A Dask cluster of separate processes, some of which are killed, stopped, slow, late or wrong."""

import os
import signal
import threading

import numpy as np
import pytest

pytest.importorskip("distributed", reason="needs the extra cluster")
pytest.importorskip("resource", reason="forks workers")

import ncrs_envs
from ncrs.engines.base import EngineError, EngineSettingError, make_engine
from ncrs.engines.cluster import dask
from ncrs.engines.pool import WorkerWarning
from ncrs_envs.scenario import Scenario, sample_scenarios
from ncrs_envs.tasks import LIGHT_CHASE, TASKS, Task, TaskSettings
from tests.engines.cluster.conftest import SCENARIOS, SETTINGS
from tests.engines.cluster.processes import Processes, Zygote, wait_for


@pytest.fixture(scope="module")
def zygote():
    with Zygote() as made:
        yield made


@pytest.fixture(scope="module")
def processes(zygote, tmp_path_factory):
    with Processes(zygote, tmp_path_factory.mktemp("dask")) as made:
        yield made


@pytest.fixture
def workers(processes):
    """Starts workers for one test; their process ids."""
    started = []

    def start(count, harm=None):
        started.extend(processes.add_worker(harm) for _ in range(count))
        return started

    yield start
    for process in started:
        processes.end(process)


@pytest.fixture
def population(genomes):
    return genomes(60)


@pytest.fixture
def joined(processes):
    """Joins the cluster once a number of workers are there."""
    made = []

    def join(count, settings=SETTINGS, **options):
        made.append(make_engine("dask", settings, scheduler=processes.scheduler_file, **options))
        wait_for(lambda: len(made[-1].crew.seats()) == count)
        return made[-1]

    yield join
    for engine in made:
        engine.close()


class Hook:
    """A request to stop that never comes, but does something after a number of polls."""

    def __init__(self, action, after=4):
        self._action, self._left = action, after

    def __call__(self):
        self._left -= 1
        if not self._left:
            self._action()
        return False


def test_a_killed_worker_changes_no_bit(workers, joined, population, check):
    first, _ = workers(2, "slowness")
    engine = joined(2)
    check(engine.evaluate(population, SCENARIOS, Hook(lambda: os.kill(first, signal.SIGKILL))))
    counts = engine.metrics()
    assert counts["workers/count"] == 1
    assert 1 <= counts["workers/lost"] <= 2  # each shard that it held, once
    check(engine.evaluate(population, SCENARIOS))


def test_workers_of_another_version_are_refused_or_warned_of(processes, workers, joined):
    workers(1)
    workers(1, "version")
    processes.wait_for_workers(2)
    with pytest.raises(EngineSettingError, match=r"worker tcp://.* has numba 0\.1 \(here .*warn"):
        joined(2)
    with pytest.warns(WorkerWarning, match=r"has numba 0\.1 .* numbers may differ"):
        joined(2, other_versions="warn")


def test_large_shards_are_nothing_to_warn_of(workers, joined, recwarn):
    workers(1)
    engine = joined(1, threads=100)  # so that all genomes, 11 MB, are one shard's size
    engine.evaluate(np.zeros((600, 4572)), SCENARIOS[:1])
    assert not [str(warning.message) for warning in recwarn]


@pytest.mark.slow
def test_a_registered_task_travels_with_its_functions(workers, joined, full_genome, monkeypatch):
    monkeypatch.setattr(TASKS, "_entries", dict(TASKS._entries))
    factor = 0.25

    def place(rng, region, grid_size, noise):
        return Scenario(start=(0.0, 0.0), light=(10.0 * region, rng.uniform(20.0, 25.0)))

    def reward(episode):
        return factor * episode.pose[1]

    parts = LIGHT_CHASE.required_parts
    own = Task("lab", "Lab-v0", 20.0, parts, has_light=True, place=place, reward=reward)
    ncrs_envs.register_task(own)
    scenarios = sample_scenarios("lab", 0, 2)
    workers(1)
    result = joined(1, TaskSettings("lab")).evaluate(full_genome[None], scenarios)
    with make_engine("box2d", TaskSettings("lab"), 1) as engine:
        expected = engine.evaluate(full_genome[None], scenarios)
    np.testing.assert_array_equal(result.episode_fitness, expected.episode_fitness)
    assert (result.episode_fitness != 0.0).all()


def test_a_task_that_cannot_travel_is_refused(monkeypatch):
    monkeypatch.setattr(TASKS, "_entries", dict(TASKS._entries))
    lock = threading.Lock()
    own = Task(
        "locked", "Locked-v0", 20.0, LIGHT_CHASE.required_parts, has_light=True,
        reward=lambda episode: float(lock.locked()),
    )  # fmt: skip
    ncrs_envs.register_task(own)
    with pytest.raises(EngineSettingError, match="'locked' cannot be sent to workers: cannot pick"):
        make_engine("dask", TaskSettings("locked"))


def test_a_lost_scheduler_is_one_sentence(zygote, tmp_path, population, caplog):
    with Processes(zygote, tmp_path) as own:
        own.add_worker("slowness")
        with (
            make_engine("dask", SETTINGS, scheduler=own.scheduler_file) as engine,
            pytest.raises(EngineError, match="does not answer any more; start it again") as caught,
        ):
            engine.evaluate(population, SCENARIOS, Hook(lambda: own.end(own.scheduler)))
        assert "Traceback" not in caplog.text
        assert "\n" not in str(caught.value)


def test_a_scheduler_that_is_not_there_is_named(monkeypatch):
    monkeypatch.setattr(dask, "_CONNECT_S", 1)
    with pytest.raises(
        EngineSettingError, match=r"No Dask scheduler answers at tcp://127\.0\.0\.1"
    ):
        make_engine("dask", SETTINGS, scheduler="tcp://127.0.0.1:9")
    with pytest.raises(EngineSettingError, match=r"No Dask scheduler answers at no/such\.json"):
        make_engine("dask", SETTINGS, scheduler="no/such.json")


def test_a_scheduler_file_may_just_be_being_written(tmp_path):
    file = tmp_path / "scheduler.json"
    file.write_text("")
    with pytest.raises(ValueError, match=r"scheduler\.json holds no address of a scheduler"):
        dask.address_in(file, limit_s=0.1)
    threading.Timer(0.2, file.write_text, ['{"address": "tcp://127.0.0.1:9"}']).start()
    assert dask.address_in(file) == "tcp://127.0.0.1:9"


@pytest.mark.slow
def test_a_stopped_workers_shards_are_taken_over(workers, joined, population, check):
    first, _ = workers(2, "slowness")
    engine = joined(2)
    check(engine.evaluate(population, SCENARIOS))
    check(engine.evaluate(population, SCENARIOS, Hook(lambda: os.kill(first, signal.SIGSTOP))))
    counts = engine.metrics()
    assert counts["workers/duplicated"] >= 1
    assert counts["workers/lost"] == 0
    check(engine.evaluate(population, SCENARIOS))
    os.kill(first, signal.SIGCONT)
    check(engine.evaluate(population, SCENARIOS))


@pytest.mark.slow
def test_slow_workers_change_no_bit(workers, joined, population, check):
    workers(1)
    workers(1, "slowness")
    engine = joined(2)
    for _ in range(3):
        check(engine.evaluate(population, SCENARIOS))
    assert engine.metrics()["workers/duplicated"] >= 1


@pytest.mark.slow
def test_a_late_worker_takes_part_unless_its_version_is_another(workers, joined, population, check):
    workers(1, "slowness")
    engine = joined(1)
    check(engine.evaluate(population, SCENARIOS, Hook(lambda: workers(1))))
    wait_for(lambda: len(engine.crew.seats()) == 2)
    check(engine.evaluate(population, SCENARIOS))
    assert engine.metrics()["workers/checked"] >= 1  # which takes two
    workers(1, "version")
    members = engine.crew._members
    wait_for(lambda: engine.crew.seats() and sum(m.is_judged for m in members.values()) == 3)
    assert len(engine.crew.seats()) == 2
    check(engine.evaluate(population, SCENARIOS))


@pytest.mark.slow
def test_a_worker_that_computes_other_numbers_is_named(workers, joined, full_genome):
    workers(1)
    workers(1, "arithmetic")
    engine = joined(2, audit=1.0)
    with pytest.warns(WorkerWarning, match=r"Genome 0 got fitness .* from the worker tcp://.* on"):
        engine.evaluate(full_genome[None], SCENARIOS)
    assert engine.metrics()["workers/differences"] == 1


@pytest.mark.slow
def test_without_a_scheduler_workers_are_started_here_and_end_with_the_engine(population, check):
    from tests.engines.test_pool import alive

    with make_engine("dask", SETTINGS, 2) as engine:
        check(engine.evaluate(population, SCENARIOS))
        pids = list(engine.crew._client.run(os.getpid).values())
        assert len(pids) == 2
        os.kill(pids[0], signal.SIGKILL)
        check(engine.evaluate(population, SCENARIOS))
        wait_for(lambda: len(engine.crew.seats()) == 2)  # it was started again
        pids += engine.crew._client.run(os.getpid).values()
    wait_for(lambda: not any(alive(pid) for pid in pids))
