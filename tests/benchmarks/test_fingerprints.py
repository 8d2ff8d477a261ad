"""Fingerprints change with what is computed, and with nothing else."""

import dataclasses
import json

import numpy as np
import pytest

import ncrs
from benchmarks.fingerprints import (
    COMMON_OVERRIDES,
    REPORTED_RUNS,
    RUNS,
    data_of,
    differences,
    digest,
    evaluation_digest,
    leaves,
    report_fingerprint,
    run_fingerprint,
    text_digest,
    train,
)
from ncrs.engines.base import CLUSTER_ENGINES, CUDA_ENGINE, ENGINES
from ncrs.evolution.optimizers import OPTIMIZERS
from ncrs_envs import TASKS
from ncrs_envs.body import body_measures

VALUES = np.arange(3, dtype=np.int64)


def test_a_digest_is_of_dtype_shape_and_values():
    assert digest(VALUES) == "038312408febdd74"
    others = [VALUES.astype(np.int32), VALUES[None], VALUES[::-1], VALUES + 1]
    assert len({digest(VALUES), *map(digest, others)}) == 5
    assert digest(VALUES, VALUES) != digest(VALUES)
    assert digest(np.arange(6, dtype=np.int64)[::2] // 2) == digest(VALUES)


def test_a_text_digest_ignores_the_order():
    assert text_digest(["1", "0.5"]) == text_digest(["0.5", "1"])
    assert text_digest(["1", "0.5"]) != text_digest(["1", "0.25"])


def test_every_array_of_an_evaluation_counts():
    bodies = np.full((1, 3, 3), 4, dtype=np.int8)
    evaluation = ncrs.Evaluation(
        fitness=np.zeros(1),
        episode_fitness=np.zeros((1, 2)),
        success=np.zeros((1, 2), dtype=bool),
        crossed=np.zeros((1, 2), dtype=bool),
        closest=np.zeros((1, 2, 1)),
        bodies=bodies,
        valid=np.zeros(1, dtype=bool),
        measures=body_measures(bodies),
        recovered=np.ones((1, 2)),
    )
    digests = {evaluation_digest(evaluation)}
    for item in dataclasses.fields(evaluation):
        changed = getattr(evaluation, item.name) + np.int8(1)
        digests.add(evaluation_digest(dataclasses.replace(evaluation, **{item.name: changed})))
    assert len(digests) == 10


def test_the_runs_cover_every_optimizer_task_and_engine():
    def chosen(group, default):
        return {overrides.get(group, default) for overrides in RUNS.values()}

    assert chosen("optimizer", "sep_cma_es") == set(OPTIMIZERS)
    assert chosen("task", "light_chase") == set(TASKS)
    elsewhere = {CUDA_ENGINE, *CLUSTER_ENGINES}  # on a GPU; on workers that use the others
    assert chosen("engine", "batched") == set(ENGINES) - elsewhere
    assert set(REPORTED_RUNS) <= set(RUNS)


@pytest.mark.slow
def test_a_runs_fingerprint_is_of_its_results_not_of_its_times(tmp_path):
    small = {"generations": "1", "optimizer.population": "16", "champion_every": "1"}
    train(tmp_path, {**COMMON_OVERRIDES, **small, "start_from": "light_chase/best"})
    found = run_fingerprint(tmp_path)
    assert found.keys() == {"archive", "elites", "champion", "metrics"}
    assert 0 < found["elites"] <= 16
    names, values = (line.split(",") for line in (tmp_path / "metrics.csv").read_text().split())
    for name, differs in (("time/ask_s", False), ("fitness/best", True)):
        changed = list(values)
        changed[names.index(name)] = "0.125"
        (tmp_path / "metrics.csv").write_text("\n".join(map(",".join, (names, changed))) + "\n")
        assert (run_fingerprint(tmp_path)["metrics"] != found["metrics"]) is differs


def test_a_run_that_fails_says_why(tmp_path):
    with pytest.raises(RuntimeError, match="no_such_task"):
        train(tmp_path / "run", {"task": "no_such_task"})


def test_a_reports_values_are_read_from_its_scripts(tmp_path):
    data = tmp_path / "report" / "data"
    data.mkdir(parents=True)
    robots = {"measures": [[1, 2, 9]], "fitness": [0.5], "success": [1.0], "generation": [3]}
    overview = {"robots": {**robots, "body": ["(;)"], "color": "red"}, "run": "name"}
    (data / "overview.js").write_text(f'receive("overview",0,{json.dumps(overview)});\n')
    (data / "robots-0.js").write_text('receive("robots",0,[{"a":[1,2.5]},null]);\n')
    assert data_of('receive("robots",0,[{"a":[1,2.5]},null]);\n') == [{"a": [1, 2.5]}, None]
    assert list(leaves([{"a": [1, 2.5]}, None])) == ["1", "2.5", "null"]
    assert report_fingerprint(tmp_path) == {
        "overview.js": text_digest(["1", "2", "9", "0.5", "1.0", "3", '"(;)"']),
        "robots-0.js": text_digest(["1", "2.5", "null"]),
    }


def test_differences_name_both_values():
    before = {"a": "1", "b": {"archive": "2"}, "gone": "3"}
    assert differences(before, {"a": "1", "b": {"archive": "2"}}) == []
    assert differences(before, {"a": "0", "new": "4"}) == [("a", "1", "0"), ("new", None, "4")]
