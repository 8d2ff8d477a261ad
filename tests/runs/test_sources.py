"""Robots from every source, and what is refused."""

import dataclasses
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

import ncrs
from ncrs.automaton.channels import GenomeError
from ncrs.runs.champion import Champion
from ncrs.runs.checkpoint import CheckpointError
from ncrs.runs.elites import EliteArchive, make_archive
from ncrs.runs.engine_settings import ConfigError
from ncrs.runs.robot import EvolvedRobot
from ncrs.runs.sources import SourceError, load_robot
from ncrs_envs.body import BodyError, body_measures
from ncrs_envs.tasks import TaskError, TaskSettings


@pytest.fixture
def champion(full_genome):
    body = ncrs.grow(ncrs.NCA().set_genome(full_genome))
    return Champion(full_genome, body, TaskSettings(), 0.4, 0.25, 7, "mean")


@pytest.fixture
def run_dir(champion, tmp_path):
    champion.save(tmp_path / "champion.npz")
    archive = make_archive(champion.task)
    archive.add(
        champion.genome[None],
        np.array([0.3]),
        body_measures(champion.body)[None],
        champion.body[None],
        success=np.array([0.5]),
    )
    EliteArchive(champion.task, archive, 12).save(tmp_path / "archive.npz")
    np.save(tmp_path / "genome.npy", champion.genome)
    (tmp_path / "genome.json").write_text(json.dumps(record(champion)))
    np.savez(tmp_path / "genome.npz", genome=champion.genome)
    np.savetxt(tmp_path / "genome.csv", champion.genome)
    (tmp_path / "evaluation.json").write_text('{"task": "light_chase", "fitness": 0.4}')
    (tmp_path / "list.json").write_text("[1, 2]")
    (tmp_path / "broken.json").write_text('{"task": "light')
    (tmp_path / "broken.npz").write_bytes(b"PK")
    return tmp_path


def record(robot, **changes):
    """What a report's page saves as JSON."""
    return {
        "task": robot.task.name,
        "grid_size": robot.task.grid_size,
        "distance_score": robot.task.distance_score,
        "success_radius": robot.task.radius,
        "measures": robot.measures,
        "fitness": robot.fitness,
        "success": robot.success,
        "generation": 7,
        "genome": robot.genome.astype(float).tolist(),
        **changes,
    }


def test_all_sources_give_the_same_kind_of_robot(champion, run_dir, monkeypatch):
    monkeypatch.chdir(run_dir)
    measures = champion.measures
    robots = {
        "champion of generation 7": load_robot(run_dir),
        f"elite with measures {measures}": load_robot(run_dir, measures=measures),
        "genome": load_robot("genome.npy", task="light_chase"),
        "again": load_robot(Path("genome.json").rename("again.json")),
    }
    for title, robot in robots.items():
        assert isinstance(robot, EvolvedRobot)
        assert robot.title == title
        assert robot.task == champion.task
        assert robot.measures == measures == tuple(body_measures(champion.body).tolist())
        np.testing.assert_array_equal(robot.genome, champion.genome)
        np.testing.assert_array_equal(robot.body, champion.body)
        np.testing.assert_array_equal(robot.growth().bodies[-1], champion.body)
    found = [robot.fitness for robot in robots.values()]
    np.testing.assert_array_equal(found, [0.4, 0.3, np.nan, 0.4])
    published = load_robot("light_chase/best")
    assert published.title == published.name == "light_chase/best"
    assert published.card["tests"]["box2d"]["success"]["fraction"] > 0.9


def test_a_path_comes_before_a_name(champion, run_dir, monkeypatch):
    monkeypatch.chdir(run_dir)
    (run_dir / "light_chase").mkdir()
    champion.save(run_dir / "light_chase" / "best")
    assert load_robot("light_chase/best").title == "champion of generation 7"


@pytest.mark.parametrize(
    ("source", "options", "error", "message"),
    [
        ("nowhere", {}, SourceError, "does not exist"),
        ("nowhere", {"measures": (1, 2, 3)}, SourceError, "does not exist"),
        ("light_chase/best", {"measures": (1, 2, 3)}, SourceError, "is not a run or an archive"),
        ("light_chase/best", {"task": "obstacle"}, SourceError, "has its own"),
        ("genome.npy", {}, SourceError, "name its task"),
        ("genome.npy", {"measures": (1, 2, 3)}, SourceError, "is not a run or an archive"),
        ("genome.npy", {"task": "carry_ball"}, GenomeError, "4873 weights"),
        ("empty", {}, ConfigError, "holds no run"),
        ("genome.csv", {}, SourceError, r"no file of a robot: give a genome as \.npy or .*\.json"),
        ("genome.csv", {"task": "light_chase"}, SourceError, "no file of a robot"),
        ("genome.npz", {}, SourceError, r"the arrays \['genome'\].*give a genome as \.npy"),
        ("genome.json", {"task": "obstacle"}, SourceError, "has its own"),
        ("genome.json", {"measures": (1, 2, 3)}, SourceError, "is not a run or an archive"),
        ("evaluation.json", {}, SourceError, "lacks genome"),
        ("list.json", {}, SourceError, "lacks genome and task"),
        ("broken.json", {}, SourceError, "is not a JSON file"),
        ("broken.npz", {}, CheckpointError, "not a whole checkpoint"),
        ("archive.npz", {}, SourceError, "choose an elite by its measures"),
        ("champion.npz", {"measures": (1, 2, 3)}, SourceError, "holds a champion alone"),
    ],
)
def test_what_holds_no_robot_is_refused(run_dir, monkeypatch, source, options, error, message):
    monkeypatch.chdir(run_dir)
    (run_dir / "empty").mkdir()
    with pytest.raises(error, match=message):
        load_robot(source, **options)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"task": "flying"}, TaskError, "Unknown task"),
        ({"task": ["obstacle"]}, TaskError, "Unknown task"),
        ({"task": "carry_ball"}, GenomeError, "4873 weights"),
        ({"grid_size": 2}, BodyError, "grid_size must be at least 3"),
        ({"fitness": "high"}, SourceError, "must be numbers, got 'high'"),
        ({"genome": "0.1 0.2"}, GenomeError, "real numbers"),
        ({"genome": [[0.1], [0.2, 0.3]]}, GenomeError, "array of numbers"),
    ],
)
def test_a_record_that_is_no_robot_is_refused(champion, tmp_path, changes, error, message):
    (tmp_path / "robot.json").write_text(json.dumps(record(champion, **changes)))
    with pytest.raises(error, match=message):
        load_robot(tmp_path / "robot.json")


def test_a_record_brings_its_settings(champion, tmp_path):
    path = tmp_path / "robot.json"
    other = TaskSettings("obstacle", 5, "inverse_square", 12.5)
    robot = dataclasses.replace(champion, task=other)
    path.write_text(json.dumps(record(robot, fitness=None)))
    loaded = load_robot(path)
    assert loaded.task == other
    assert math.isnan(loaded.fitness)
    path.write_text(json.dumps({"task": "light_chase", "genome": record(champion)["genome"]}))
    assert load_robot(path).task == TaskSettings()


def test_the_reports_page_saves_that_record(champion):
    page = Path(ncrs.__file__).parent / "report" / "page" / "robot.js"
    written = re.search(r"JSON.stringify\(\{(.*?)\n    \}\)", page.read_text(), re.DOTALL)
    names = re.findall(r"^\s+(\w+):", written[1], re.MULTILINE)
    assert names == list(record(champion))


def test_a_champion_may_have_any_name(champion, tmp_path):
    champion.save(tmp_path / "best.v2")
    assert load_robot(tmp_path / "best.v2").title == champion.title


def test_a_robot_is_checked_where_it_is_made(champion):
    with pytest.raises(GenomeError, match="4572 weights"):
        dataclasses.replace(champion, genome=champion.genome[:-1])
    with pytest.raises(GenomeError, match="4873"):
        dataclasses.replace(champion, task=TaskSettings("carry_ball"))
    with pytest.raises(BodyError, match="and at least 2 wheels"):
        dataclasses.replace(champion, body=np.ones((5, 5), dtype=np.int8))
    with pytest.raises(BodyError):
        dataclasses.replace(champion, body=champion.body[:4, :4])
