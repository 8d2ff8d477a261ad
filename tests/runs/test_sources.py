"""Robots from every source, and what is refused."""

import dataclasses

import numpy as np
import pytest

import ncrs
from ncrs.automaton.channels import GenomeError
from ncrs.runs.champion import Champion
from ncrs.runs.elites import EliteArchive, make_archive
from ncrs.runs.robot import EvolvedRobot
from ncrs.runs.settings import ConfigError
from ncrs.runs.sources import SourceError, load_robot
from ncrs_envs.body import BodyError, body_measures
from ncrs_envs.tasks import TaskSettings


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
    return tmp_path


def test_all_sources_give_the_same_kind_of_robot(champion, run_dir, monkeypatch):
    monkeypatch.chdir(run_dir)
    measures = champion.measures
    robots = {
        "champion of generation 7": load_robot(run_dir),
        f"elite with measures {measures}": load_robot(run_dir, measures=measures),
        "genome": load_robot("genome.npy", task="light_chase"),
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
    np.testing.assert_array_equal(found, [0.4, 0.3, np.nan])
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
    ],
)
def test_what_holds_no_robot_is_refused(run_dir, monkeypatch, source, options, error, message):
    monkeypatch.chdir(run_dir)
    (run_dir / "empty").mkdir()
    with pytest.raises(error, match=message):
        load_robot(source, **options)


def test_a_robot_is_checked_where_it_is_made(champion):
    with pytest.raises(GenomeError, match="4572 weights"):
        dataclasses.replace(champion, genome=champion.genome[:-1])
    with pytest.raises(GenomeError, match="4873"):
        dataclasses.replace(champion, task=TaskSettings("carry_ball"))
    with pytest.raises(BodyError, match="and at least 2 wheels"):
        dataclasses.replace(champion, body=np.ones((5, 5), dtype=np.int8))
    with pytest.raises(BodyError):
        dataclasses.replace(champion, body=champion.body[:4, :4])
