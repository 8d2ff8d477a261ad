"""Elites of real robots: their file, their record, new estimates, and other formats."""

import csv
import dataclasses
import re
from dataclasses import replace

import numpy as np
import pytest

import ncrs
from ncrs.cli import main
from ncrs.commands.archive import reestimated
from ncrs.engines.base import make_engine
from ncrs.evolution.reestimation import reestimate
from ncrs.evolution.standstill import standing_still_fitness
from ncrs.runs.checkpoint import CheckpointError, write_state
from ncrs.runs.elites import EliteArchive, EliteError, load_archive, make_archive, measure_space
from ncrs.runs.engine_settings import ConfigError
from ncrs.runs.exports import write_csv
from ncrs.runs.seeds import Stream, seed_row, seed_sequence
from ncrs_envs import PerturbationSettings
from ncrs_envs.mirroring import ScenarioSampling
from ncrs_envs.scenario import Scenario, sample_scenarios
from ncrs_envs.tasks import TASKS, TaskSettings

EPISODES = 4
STREAM = seed_sequence(11, Stream.SCENARIOS, 5)


@pytest.fixture(scope="module")
def found():
    """Elites among 48 random genomes, as training would file them, with their evaluation."""
    task = TaskSettings()
    settings = task
    genomes = np.random.default_rng(0).normal(0.0, 0.1, (48, 4572)).astype(np.float32)
    scenarios = sample_scenarios(settings.task, STREAM, EPISODES, 5)
    with make_engine("box2d", settings, 1) as engine:
        evaluation = engine.evaluate(genomes, scenarios)
    archive = make_archive(settings)
    archive.add(
        genomes,
        evaluation.fitness,
        evaluation.measures,
        evaluation.bodies,
        success=evaluation.success.mean(axis=1),
        standing_still=standing_still_fitness(settings, scenarios),
        generation=5,
        seeds=seed_row(STREAM),
    )
    return EliteArchive(task, archive, EPISODES), genomes, evaluation


@pytest.fixture
def saved(found, tmp_path):
    path = tmp_path / "archive.npz"
    found[0].save(path)
    return path


@pytest.mark.parametrize(
    ("task", "side", "count"),
    [("light_chase", 5, 2300), ("obstacle", 5, 2300), ("carry_ball", 5, 2024), ("obstacle", 3, 84)],
)
def test_the_triples_of_each_task(task, side, count):
    assert len(measure_space(TASKS[task], side).triples) == count


def test_only_valid_bodies_are_elites(found):
    elites, _, evaluation = found
    valid = evaluation.measures[evaluation.valid]
    assert len(elites.archive) == len(np.unique(valid, axis=0)) >= 3


def test_an_elite_is_ready_to_use(found, saved):
    _, genomes, evaluation = found
    index = int(np.nanargmax(np.where(evaluation.valid, evaluation.fitness, np.nan)))
    measures = tuple(evaluation.measures[index].tolist())
    for path in (saved, saved.parent):
        elite = ncrs.load_elite(path, measures=measures)
        assert elite.measures == measures
        assert elite.fitness == evaluation.fitness[index]
        assert elite.success == evaluation.success[index].mean()
        assert (elite.generation, elite.evaluation_seed) == (5, (11, 1, 5))
        assert elite.task == TaskSettings()
        np.testing.assert_array_equal(elite.genome, genomes[index])
        np.testing.assert_array_equal(elite.body, evaluation.bodies[index])
        np.testing.assert_array_equal(ncrs.grow(elite.nca), elite.body)


def test_an_elites_fitness_can_be_had_again_from_its_seed(found):
    elites, _, _ = found
    elite = elites.elite(elites.archive.measures[0].tolist())
    again = elite.evaluate(engine="box2d")
    assert again.fitness[0] == elite.fitness
    sterner = dataclasses.replace(elite, task=TaskSettings(distance_score="inverse_square"))
    assert sterner.evaluate(engine="box2d").fitness[0] < elite.fitness


def test_what_is_not_there_is_said_with_what_is_nearest(found):
    elites, _, _ = found
    filled = [tuple(row) for row in elites.archive.measures.tolist()]
    empty = next(
        tuple(row) for row in elites.archive.space.triples.tolist() if tuple(row) not in filled
    )
    nearest = min(filled, key=lambda row: np.abs(np.subtract(row, empty)).sum())
    with pytest.raises(EliteError, match="is empty; the nearest filled are") as caught:
        elites.elite(empty)
    assert str(nearest) in str(caught.value)
    with pytest.raises(EliteError, match="is impossible: at least 1 sensors and 2 wheels"):
        elites.elite((0, 2, 8))
    for wrong in [(2, 8), (2.0, 8.0, 25.0)]:
        with pytest.raises(EliteError, match="three integers"):
            elites.elite(wrong)
    with pytest.raises(EliteError, match="no elites"):
        EliteArchive(TaskSettings(), make_archive(TaskSettings()), 1).elite((1, 2, 3))


def test_files_that_hold_no_archive(saved, tmp_path):
    with pytest.raises(ConfigError, match="does not exist"):
        load_archive(tmp_path / "nothing")
    damaged = tmp_path / "damaged.npz"
    content = bytearray(saved.read_bytes())
    content[len(content) // 2] ^= 1
    damaged.write_bytes(content)
    with pytest.raises(CheckpointError, match="not a whole checkpoint"):
        load_archive(damaged)
    write_state(tmp_path / "other.npz", {"generation": 3})
    with pytest.raises(CheckpointError, match="does not hold an archive"):
        load_archive(tmp_path / "other.npz")
    foreign = make_archive(TaskSettings(name="carry_ball"))
    EliteArchive(TaskSettings(), foreign, 1).save(tmp_path / "foreign.npz")
    with pytest.raises(CheckpointError, match="does not fit its task"):
        load_archive(tmp_path / "foreign.npz")


def test_a_file_needs_no_pickle(saved):
    with np.load(saved, allow_pickle=False) as file:
        assert all(file[name].dtype != object for name in file.files)


@pytest.mark.parametrize(
    ("task", "scenario", "expected"),
    [
        ("light_chase", Scenario(start=(0, 0), light=(0, 60)), np.exp(-1)),
        ("carry_ball", Scenario(start=(0, 0), ball=(30, 0), target=(30, 60)),
         (np.exp(-0.5) + np.exp(-1)) / 2),
    ],
)  # fmt: skip
def test_standing_still(task, scenario, expected):
    settings = TaskSettings(task)
    assert standing_still_fitness(settings, [scenario]) == pytest.approx(expected)
    np.testing.assert_allclose(standing_still_fitness(settings, [[scenario]] * 3), [expected] * 3)


@pytest.mark.parametrize("task", TASKS)
def test_standing_still_is_what_the_engine_gives_a_robot_without_gas(task):
    from ncrs_envs.episode import Episode, Robot
    from ncrs_envs.tasks import default_body

    settings = TaskSettings(task, distance_score="inverse_square")
    scenarios = sample_scenarios(task, 3, 4)
    robot = Robot(default_body(settings.task, 5))
    rewards = [
        np.mean([episode.step(np.zeros((5, 5))) for _ in range(20)])
        for episode in (Episode(settings, robot, scenario) for scenario in scenarios)
    ]
    assert standing_still_fitness(settings, scenarios) == pytest.approx(np.mean(rewards), abs=1e-9)


def test_new_estimates_come_from_the_fresh_scenarios(found):
    elites, _, _ = found
    copy = type(elites.archive).from_state(elites.archive.state())
    stream = seed_sequence(77, Stream.REESTIMATION, 9)
    scenarios = sample_scenarios("light_chase", stream, 3)
    with make_engine("box2d", TaskSettings(), 1) as engine:
        estimate = reestimate(copy, engine, scenarios, seed_row(stream))
        assert estimate.dropped == 0
        expected = engine.evaluate(elites.archive.column("genomes"), scenarios)
    np.testing.assert_array_equal(copy.cells, elites.archive.cells)
    np.testing.assert_array_equal(copy.column("fitness"), expected.fitness)
    scores = expected.episode_fitness.sum(axis=0) / len(copy.space.triples)
    assert copy.statistics()["qd_score"] == pytest.approx(scores.mean())
    assert estimate.qd_score_error == pytest.approx(scores.std(ddof=1) / 3**0.5)
    np.testing.assert_array_equal(copy.column("success"), expected.success.mean(axis=1))
    assert (copy.column("seeds") == [77, 4, 9, -1]).all()
    assert (copy.column("generations") == 5).all()
    assert (copy.column("standing_still") != elites.archive.column("standing_still")).all()


def test_csv(found, tmp_path):
    elites, _, _ = found
    write_csv(elites, tmp_path / "archive.csv")
    with (tmp_path / "archive.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == len(elites.archive)
    for row, measures in zip(rows, elites.archive.measures.tolist(), strict=True):
        elite = elites.elite(measures)
        assert [int(row[name]) for name in ("sensors", "wheels", "cells")] == measures
        assert float(row["fitness"]) == elite.fitness
        assert row["evaluation_seed"] == "11 1 5"
        assert row["body"].count("W") == measures[1]
        assert len(row["body"].split("/")) == 5


def test_the_archive_command(found, saved, capsys):
    folder = saved.parent
    main(["archive", str(folder), "--reestimate", "--episodes", "2", "--export", "csv"])
    output = capsys.readouterr().out
    count = len(found[0].archive)
    assert f"{count} of 2,300 measure triples" in output
    assert "the paper's 2,024" in output
    assert "standing still earns 0.42" in output
    assert re.search(r"QD-score 0\.\d{4} \+- 0\.\d{4} standard error", output)
    again = load_archive(folder / "archive_reestimated.npz")
    assert again.episodes == 2
    np.testing.assert_array_equal(again.archive.cells, found[0].archive.cells)
    np.testing.assert_array_equal(
        load_archive(folder).archive.column("fitness"), found[0].archive.column("fitness")
    )
    assert (folder / "archive.csv").is_file()


def test_new_estimates_are_under_the_damage_of_training(found):
    elites = found[0]
    damage = PerturbationSettings(damage_fraction=0.5)
    trained = replace(elites, sampling=ScenarioSampling(perturbations=damage))
    again, _ = reestimated(trained, "batched", 0, 2)
    assert again.sampling.perturbations == damage
    plain, _ = reestimated(elites, "batched", 0, 2)
    differ = again.archive.column("fitness") != plain.archive.column("fitness")
    assert differ.any()


def test_the_archive_command_on_nothing(tmp_path, capsys):
    with pytest.raises(SystemExit):
        main(["archive", str(tmp_path)])
    assert "does not exist" in capsys.readouterr().err


def test_the_archive_command_refuses_a_negative_seed(saved, capsys):
    with pytest.raises(SystemExit):
        main(["archive", str(saved), "--reestimate", "--seed", "-1"])
    assert "seed must be an integer from 0" in capsys.readouterr().err
