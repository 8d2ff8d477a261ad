"""Who takes part, how large shards are, and what a cluster says of its costs."""

import dataclasses
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from ncrs.engines import base
from ncrs.engines.base import EngineSettingError, NonFiniteStateWarning, make_engine
from ncrs.engines.cluster import sharded
from ncrs.engines.cluster.crew import Admission, Seat
from ncrs.engines.cluster.cutting import shard_size
from ncrs.engines.cluster.futures import FuturesEngine
from ncrs.engines.cluster.records import WorkerFacts, make_setup
from ncrs.engines.cluster.sharded import overhead_line
from ncrs.engines.cluster.station import describe_worker, own_versions
from ncrs.engines.pool import WorkerWarning
from ncrs_envs.scenario import sample_scenarios
from ncrs_envs.tasks import TaskSettings

FACTS = WorkerFacts("tcp://10.0.0.1:40000", "node1", 4, "batched", own_versions())


def other(**changes):
    return dataclasses.replace(FACTS, **changes)


def test_the_same_versions_are_admitted():
    admission = Admission("refuse", "cuda")
    assert admission.engine == "cuda"
    assert admission.objection(FACTS) is None
    assert admission.engine == "batched"


@pytest.mark.parametrize("package", ["ncrs", "numba", "numpy"])
def test_another_version_is_refused_or_warned_of_once(package):
    worker = other(versions={**FACTS.versions, package: "0.0.1"})
    text = Admission("refuse", "batched").objection(worker)
    assert text.startswith(f"The worker tcp://10.0.0.1:40000 on node1 has {package} 0.0.1 (here ")
    assert text.endswith("set engine.other_versions=warn.")
    admission = Admission("warn", "batched")
    with pytest.warns(WorkerWarning, match=f"has {package} 0.0.1"):
        assert admission.objection(worker) is None
    assert admission.objection(worker) is None  # pytest would fail on a second warning


def test_workers_with_and_without_gpus_do_not_mix():
    admission = Admission("warn", "batched")
    assert admission.objection(FACTS) is None
    text = admission.objection(other(name="tcp://10.0.0.2:40000", host="node2", engine="cuda"))
    assert "node2 would evaluate with cuda, but tcp://10.0.0.1:40000 on node1 with batched" in text
    assert "engine.on_workers=batched" in text


def test_a_worker_says_what_it_is():
    facts = describe_worker(make_setup(TaskSettings(), "box2d", 3))
    assert (facts.threads, facts.engine) == (3, "box2d")
    assert facts.host in facts.name == str(facts)


def test_a_worker_with_a_gpu_uses_it_unless_told_otherwise(monkeypatch):
    monkeypatch.setattr(base, "has_gpu", lambda: True)
    assert describe_worker(make_setup(TaskSettings(), "auto", None)).engine == "cuda"
    assert describe_worker(make_setup(TaskSettings(), "batched", None)).engine == "batched"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"audit": 1.5}, "engine.audit must be from 0 to 1, got 1.5"),
        ({"threads": 0}, "engine.threads must be positive, got 0"),
        ({"other_versions": "ask"}, "engine.other_versions must be refuse or warn, got 'ask'"),
        ({"on_workers": "bullet"}, "Unknown engine 'bullet'"),
        ({"on_workers": "dask"}, "engine.on_workers must be"),
        ({"executor": "no_such:thing"}, "'no_such:thing' cannot be imported"),
        ({"executor": "os"}, "MODULE:NAME"),
        ({"scheduler": "tcp://here:1"}, "names a Dask cluster, which the engine futures does not"),
    ],
)
def test_bad_options_are_refused(options, message):
    with pytest.raises(EngineSettingError) as caught:
        make_engine("futures", TaskSettings(), **options)
    assert message in str(caught.value)


def test_options_are_refused_by_other_engines():
    with pytest.raises(EngineSettingError, match=r"engine\.audit is .*choose engine=dask or fut"):
        make_engine("batched", TaskSettings(), audit=0.5)


def cut(population, seats, engine="batched"):
    sizes, left = [], population
    while left:
        sizes.append(shard_size(seats[len(sizes) % len(seats)], seats, left, population, engine))
        left -= sizes[-1]
    return sizes


def test_shards_become_smaller_and_are_worth_a_message():
    two = [Seat("a", 1), Seat("b", 1)]
    assert cut(112, two) == [14, 13, 11, 10, 8, 8, 8, 8, 8, 8, 8, 8]
    assert max(cut(8192, two)) == 64
    assert cut(112, two, "box2d")[0] == 4
    many = [Seat(str(index), 1) for index in range(64)]
    assert cut(112, many) == [2] * 56  # nobody gets more than the fair share
    assert cut(100_000, [Seat(str(index), 1) for index in range(512)])[0] == 196
    assert cut(8192, [Seat("a", 16), Seat("b", 48)])[:2] == [512, 1440]


def test_a_cluster_says_once_that_it_does_not_pay(genomes, monkeypatch):
    said = []
    monkeypatch.setattr(sharded, "notice", said.append)
    scenarios = sample_scenarios("light_chase", 0, 1)
    with FuturesEngine(TaskSettings(), 1, ThreadPoolExecutor) as engine:
        for count in (4, 1, 4):  # small ones are candidates for champion
            engine.evaluate(genomes(count), scenarios)
        assert not said
        for _ in range(3):
            engine.evaluate(genomes(4), scenarios)
    assert len(said) == 1
    assert "s went into sending and waiting" in said[0]


def test_a_genome_that_does_not_grow_is_named_by_its_place_in_the_population(genomes):
    vectors = genomes(40).astype(np.float32)
    vectors[37] = 3e38  # far from the first shard
    with (
        FuturesEngine(TaskSettings(), 2, ThreadPoolExecutor) as engine,
        pytest.warns(NonFiniteStateWarning, match="state of genome 37 turned non-finite during"),
    ):
        result = engine.evaluate(vectors, sample_scenarios("light_chase", 0, 1))
    assert not result.valid[37]


def test_what_a_cluster_costs_is_said_in_numbers():
    line = overhead_line(busy_s=0.5, seconds=0.45, threads=2)
    assert line.startswith(
        "a generation is 0.5 s of work for one thread; of its 0.45 s on 2 threads, 0.2 s went"
    )
