"""Whoever computes what, and whatever becomes of the workers, results come by index."""

import re

import numpy as np
import pytest

from ncrs.engines.base import EngineError, EvaluationInterrupted
from ncrs.engines.cluster import dispatch
from ncrs.engines.cluster.audit import Audit
from ncrs.engines.cluster.crew import Admission
from ncrs.engines.cluster.dispatch import Dispatcher
from ncrs.engines.pool import WorkerWarning
from tests.engines.cluster.simulated import (
    SimulatedCrew,
    Worker,
    expected,
    make_shard,
)

POPULATION = 120


@pytest.fixture
def evaluated(monkeypatch):
    """Evaluates a population on a simulated crew, and checks the results; the dispatcher."""
    monkeypatch.setattr(dispatch, "_POLL_S", 0.0)

    def run(crew, audit=0.0, populations=1, stop=lambda: False, is_right=True):
        monkeypatch.setattr(dispatch, "monotonic", crew.monotonic)
        dispatcher = Dispatcher(crew, Admission("warn", "batched"), Audit(audit))
        for _ in range(populations):
            result = dispatcher.evaluate(POPULATION, make_shard, stop)
            for name, value in vars(expected(POPULATION)).items() if is_right else ():
                np.testing.assert_array_equal(getattr(result, name), value, err_msg=name)
        return dispatcher

    return run


def genomes_of(worker):
    return sum(last - first for first, last in worker.done)


def test_faster_workers_get_more(evaluated):
    quick, slow = Worker("quick"), Worker("slow", ticks=4)
    evaluated(SimulatedCrew(quick, slow))
    assert genomes_of(quick) > 2 * genomes_of(slow) > 0


def test_workers_with_more_threads_get_larger_shards(evaluated):
    wide, narrow = Worker("wide", threads=4), Worker("narrow")
    evaluated(SimulatedCrew(wide, narrow))
    assert wide.done[0] == (0, 32)
    assert narrow.done[0][1] - narrow.done[0][0] == 8


def test_a_killed_workers_shards_are_sent_once_more(evaluated):
    first, second = Worker("first"), Worker("second")
    crew = SimulatedCrew(first, second, script=lambda crew, tick: tick == 2 and crew.remove(second))
    dispatcher = evaluated(crew)
    assert dispatcher.tally.lost == 1
    spans = sorted(first.done + second.done)
    assert len(set(spans)) == len(spans)  # what was lost had not been answered


def test_a_worker_that_leaves_without_a_word_is_noticed(evaluated):
    first, second = Worker("first"), Worker("second")
    crew = SimulatedCrew(
        first, second, script=lambda crew, tick: tick == 2 and crew.workers.remove(second)
    )
    assert evaluated(crew).tally.lost == 1


def test_the_work_of_a_stopped_worker_is_taken_over_and_it_gets_nothing_new(evaluated):
    first, second = Worker("first"), Worker("second")

    def script(crew, tick):
        second.is_stopped = tick >= 2

    crew = SimulatedCrew(first, second, script=script)
    dispatcher = evaluated(crew, populations=3, audit=0.01)
    assert dispatcher.tally.duplicated == 2
    assert len(second.jobs) == 2
    assert dispatcher.tally.lost == 0
    second.is_stopped = False
    evaluated(SimulatedCrew(first, second))


def test_idle_workers_evaluate_the_last_tenth_too(evaluated):
    quick, slow = Worker("quick"), Worker("slow", ticks=6)
    dispatcher = evaluated(SimulatedCrew(quick, slow))
    assert dispatcher.tally.duplicated == 1


def test_a_worker_that_joins_late_takes_part(evaluated):
    late = Worker("late")
    crew = SimulatedCrew(
        Worker("first"), script=lambda crew, tick: tick == 3 and crew.workers.append(late)
    )
    evaluated(crew)
    assert genomes_of(late) > 0


def test_a_population_waits_for_workers_though_not_forever(evaluated):
    crew = SimulatedCrew(
        script=lambda crew, tick: tick == 50 and crew.workers.append(Worker("only"))
    )
    evaluated(crew)
    with pytest.raises(EngineError, match="No worker was there for 300 s; start some"):
        evaluated(SimulatedCrew())


def test_a_genome_that_ends_every_worker_is_found_and_named(evaluated):
    def script(crew, tick):
        crew.remove(crew.workers[0])
        crew.workers.append(Worker(f"worker {tick}"))

    with pytest.raises(EngineError, match="11 workers were lost while evaluating genome 0;"):
        evaluated(SimulatedCrew(Worker("first"), script=script))


def test_an_evaluation_ends_when_asked_to(evaluated):
    worker = Worker("only", ticks=1000)
    with pytest.raises(EvaluationInterrupted):
        evaluated(SimulatedCrew(worker), stop=lambda: bool(worker.jobs))
    assert all(future.cancelled() for future, _ in worker.jobs)


def test_an_error_on_a_worker_names_genomes_and_worker(evaluated, monkeypatch):
    worker = Worker("only")
    monkeypatch.setattr(
        worker, "work", lambda: worker.jobs and worker.jobs[0][0].set_exception(MemoryError("full"))
    )
    with pytest.raises(EngineError, match="full while evaluating genomes 0 to 29 on only"):
        evaluated(SimulatedCrew(worker))


@pytest.mark.parametrize("anonymous", [False, True])
def test_a_share_is_evaluated_on_a_second_worker(evaluated, anonymous):
    crew = SimulatedCrew(Worker("first"), Worker("second"), anonymous=anonymous)
    audit = evaluated(crew, audit=0.1, populations=5)._audit
    assert audit.checked == 5 * POPULATION // 10
    assert audit.differences == 0


def test_at_least_one_genome_is(evaluated):
    crew = SimulatedCrew(Worker("first"), Worker("second"))
    assert evaluated(crew, audit=0.001)._audit.checked == 1
    assert evaluated(SimulatedCrew(Worker("only")), audit=0.5)._audit.checked == 0


def test_a_difference_names_both_hosts_and_the_genome_once(evaluated):
    crew = SimulatedCrew(Worker("right"), Worker("wrong", error=0.25))
    with pytest.warns(WorkerWarning) as caught:
        audit = evaluated(crew, audit=0.1, populations=4, is_right=False)._audit
    assert audit.differences == audit.checked == 4 * POPULATION // 10
    (text,) = (str(warning.message) for warning in caught)
    named = r"Genome (\d+) got fitness \1.(0|25) from the worker (right|wrong) on host of \3, "
    assert re.match(named + r"\1.(0|25) from (right|wrong) on host of \5: one of them", text)


def test_any_history_gives_the_same_results(evaluated):
    """Workers die, leave, stop, continue, join and slow down at random."""
    for seed in range(60):
        rng = np.random.default_rng(seed)

        def script(crew, tick, rng=rng):
            event = rng.integers(12)
            if event == 0 and len(crew.workers) > 1:
                crew.remove(crew.workers[rng.integers(len(crew.workers))])
            elif event == 1 and len(crew.workers) > 1:
                crew.workers.pop(rng.integers(len(crew.workers)))
            elif event == 2 or tick % 100 == 99:
                crew.workers.append(Worker(f"worker {tick}", threads=int(rng.integers(1, 4))))
            elif event == 3 and crew.workers:
                worker = crew.workers[rng.integers(len(crew.workers))]
                worker.is_stopped = not worker.is_stopped
            elif event == 4 and crew.workers:
                crew.workers[rng.integers(len(crew.workers))].ticks = int(rng.integers(1, 8))

        evaluated(SimulatedCrew(Worker("first"), Worker("second"), script=script), 0.05, 2)
