"""Results of runs: rows, what differs, aggregates over seeds, failures, files."""

import csv
import json

import numpy as np
import pytest

import ncrs
from ncrs.cli import main
from ncrs.evolution.optimizers import SepCMAESSettings
from ncrs.runs.assessment import (
    Assessment,
    Proportion,
    find_assessment,
    genome_digest,
    save_assessment,
)
from ncrs.runs.checkpoint import CheckpointError, CheckpointFolder
from ncrs.runs.engine_settings import ConfigError
from ncrs.runs.failure import save_failure
from ncrs.runs.folders import find_runs, group_runs
from ncrs.runs.results import collect_results
from ncrs.runs.settings import TrainConfig, save_config
from ncrs.runs.statistics import bootstrap_interval, interquartile_mean


def make_run(folder, *, fitness=0.5, successes=50, done=10, generations=10, **varied):
    sigma, seed = varied.get("sigma", 0.03), varied.get("seed", 0)
    folder.mkdir(parents=True)
    optimizer = SepCMAESSettings(sigma=sigma)
    config = TrainConfig(optimizer=optimizer, seed=seed, generations=generations)
    save_config(config.resolved(), folder)
    CheckpointFolder(folder / "checkpoints").save(done, {})
    if fitness is not None:
        champion = ncrs.load_champion("light_chase/best")
        champion.save(folder / "champion.npz")
        success, digest = Proportion.of(successes, 100), genome_digest(champion)
        test = Assessment("light_chase", "box2d", 0, fitness, 0.01, success, None, "", digest)
        save_assessment(test, folder)


@pytest.fixture
def sweep(tmp_path):
    folder = tmp_path / "sweep"
    for seed, fitness in enumerate((0.1, 0.4, 0.6, 0.9)):
        make_run(
            folder / f"sigma=0.03,seed={seed}", fitness=fitness, seed=seed, successes=20 * seed
        )
    make_run(folder / "sigma=0.3,seed=0", sigma=0.3, fitness=0.2, successes=0)
    make_run(folder / "sigma=0.3,seed=1", sigma=0.3, seed=1, done=4, fitness=None)
    save_failure(folder / "sigma=-1,seed=0", "sigma must be positive.", ["seed=0"], None)
    return folder


def test_rows_name_what_differs_and_how_far_each_run_came(sweep):
    results = collect_results([sweep])
    assert results.differing == ["optimizer.sigma", "seed"]
    assert {row.name: row.status for row in results.rows} == {
        **{f"sigma=0.03,seed={seed}": "finished" for seed in range(4)},
        "sigma=0.3,seed=0": "finished",
        "sigma=0.3,seed=1": "unfinished (4 of 10 generations)",
        "sigma=-1,seed=0": "failed",
    }
    assert not results.complete


def test_aggregates_are_over_the_seeds_of_equal_settings(sweep):
    first, second = collect_results([sweep]).groups
    assert (first.seeds, second.seeds) == (4, 1)
    assert first.fitness.median == 0.5
    assert first.fitness.interquartile_mean == 0.5  # of 0.4 and 0.6
    low, high = first.fitness.interval
    assert 0.1 <= low < 0.5 < high <= 0.9
    assert first.success.median == pytest.approx(0.3)
    assert second.fitness.interval == (0.2, 0.2)


def test_a_finished_run_without_a_champion_counts_as_zero(tmp_path):
    make_run(tmp_path / "a", fitness=0.8)
    make_run(tmp_path / "b", fitness=None, seed=1)
    (group,) = collect_results([tmp_path]).groups
    assert (group.seeds, group.fitness.median) == (2, 0.4)


def test_the_command_prints_and_saves(sweep, tmp_path, capsys):
    main(["results", str(sweep), "--output", str(tmp_path / "tables")])
    printed = capsys.readouterr().out
    assert "sigma=-1,seed=0: sigma must be positive." in printed
    assert "0.100 (0.080 to 0.120)" in printed
    rows = list(csv.DictReader((tmp_path / "tables" / "results.csv").open()))
    assert len(rows) == 7
    (best,) = (row for row in rows if row["run"] == "sigma=0.03,seed=3")
    assert (best["fitness"], best["success"], best["episodes"]) == ("0.9", "0.6", "100")
    data = json.loads((tmp_path / "tables" / "results.json").read_text())
    assert len(data["groups"]) == 2
    assert (tmp_path / "tables" / "results.md").read_text().count("| sigma=") == 7


def test_folders_without_runs_are_refused(tmp_path):
    with pytest.raises(ConfigError, match="holds no run"):
        collect_results([tmp_path])


def test_three_step_sizes_of_one_seed_are_not_three_seeds(tmp_path):
    for sigma in (0.01, 0.03, 0.1):
        make_run(tmp_path / str(sigma), sigma=sigma)
    groups = group_runs(find_runs([tmp_path]))
    assert [group.variant for group in groups] == ["sigma 0.01", "sigma 0.03", "sigma 0.1"]
    assert [len(group.runs) for group in groups] == [1, 1, 1]
    assert len({group.name for group in groups}) == 3


def test_a_damaged_test_result_is_named(tmp_path):
    (tmp_path / "evaluation.json").write_text("[]")
    with pytest.raises(CheckpointError, match="Write it again with ncrs evaluate"):
        find_assessment(tmp_path, ncrs.load_champion("light_chase/best"))


def test_another_robots_test_is_not_the_champions(tmp_path):
    make_run(tmp_path / "run")
    champion = ncrs.load_champion("light_chase/best")
    assert find_assessment(tmp_path / "run", champion).fitness == 0.5
    assert find_assessment(tmp_path / "run", ncrs.load_champion("light_chase/cma_es")) is None
    assert find_assessment(tmp_path / "run", None) is None


def test_runs_of_another_length_are_another_group_and_each_counts_once(tmp_path):
    make_run(tmp_path / "a")
    make_run(tmp_path / "b", generations=5, done=5)
    results = collect_results([tmp_path, tmp_path / "a"])
    assert [row.name for row in results.rows] == ["a", "b"]
    assert results.differing == ["generations"]
    assert [group.seeds for group in results.groups] == [1, 1]


def test_statistics_by_hand():
    values = np.array([10.0, 0.0, 2.0, 1.0, 3.0, 4.0, 2.0, 100.0])
    assert interquartile_mean(values) == np.mean([2.0, 2.0, 3.0, 4.0])
    assert interquartile_mean(np.array([1.0, 2.0, 6.0])) == 3.0
    # The mean of n values has standard error s / sqrt(n).
    sample = np.random.default_rng(1).normal(size=400)
    low, high = bootstrap_interval(sample, lambda chosen: chosen.mean(axis=-1))
    assert (high - low) / 2 == pytest.approx(1.96 * sample.std() / 20, rel=0.05)
    assert bootstrap_interval([0.25]) == (0.25, 0.25)
