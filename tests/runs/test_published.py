"""The robots that come with the package: they are there, and do what their cards say."""

import shutil
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from hydra import compose, initialize_config_dir
from PIL import Image

import ncrs
import ncrs.runs.published
from ncrs.automaton.regrow_to import REPAIR_STEPS
from ncrs.cli import main
from ncrs.runs.assessment import assess
from ncrs.runs.checkpoint import CheckpointError
from ncrs.runs.published import ChampionError, champions_folder, file_stem
from ncrs.runs.settings import config_from_dict
from ncrs.runs.sources import SourceError, load_robot
from ncrs.training.hydra import register, train_config
from ncrs_envs import PerturbationSettings
from ncrs_envs.tasks import PAPER_TASKS

ROOT = Path(__file__).parents[2]
RECIPES = ("best", "cma_es", "cma_me")
CURRICULUM = "light_chase/curriculum"
"""Champion from which the best search in CarryBall started."""
COMPILED = "carry_ball/compiled"
"""Robot by hand whose gains were searched."""
SURVIVORS = ("light_chase/robust", "light_chase/repair")
"""Robots by hand that go on after damage."""
NAMES = sorted(
    [
        *(f"{task.name}/{recipe}" for task in PAPER_TASKS for recipe in RECIPES),
        CURRICULUM,
        COMPILED,
        *SURVIVORS,
    ]
)


def test_all_are_listed():
    assert ncrs.champions() == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_a_champion_does_in_box2d_what_its_card_says(name):
    """On other episodes: 100 here, where the published 1,000 had another seed."""
    champion = ncrs.load_champion(name)
    published = champion.card["tests"]["box2d"]
    again = assess(champion, episodes=100, seed=2)
    low, high = again.success.interval
    assert low <= published["success"]["fraction"] <= high
    assert abs(again.fitness - published["fitness"]) <= 3 * again.fitness_standard_error
    assert published["success"]["episodes"] == 1000


@pytest.mark.parametrize("name", NAMES)
def test_a_champion_is_complete(name):
    champion = ncrs.load_champion(name)
    assert champion.name == name
    assert champion.task.name == name.split("/")[0]
    np.testing.assert_array_equal(ncrs.grow(champion.nca, champion.task.grid_size), champion.body)
    config = config_from_dict(champion.card["config"])
    assert config.task == champion.task
    for command in champion.card["commands"]:
        assert command.startswith("python train.py ")
    with Image.open(champions_folder() / f"{file_stem(name)}.png") as picture:
        assert picture.width > picture.height > 100


def test_the_best_light_chaser_beats_the_papers():
    """The paper's best evolved robots reach a fitness of 0.615, and 92 % success."""
    published = ncrs.load_champion("light_chase/best").card["tests"]["box2d"]
    assert published["fitness"] > 0.615
    assert published["success"]["fraction"] >= 0.95


@pytest.mark.parametrize(
    ("name", "success", "recovered", "repair_steps"),
    [("light_chase/robust", 0.6, 0.0, 0), ("light_chase/repair", 0.85, 0.9, REPAIR_STEPS)],
)
def test_survivors_reach_the_light_after_damage(name, success, recovered, repair_steps):
    """With 30 % of the modules lost at a random step of the first half."""
    settings = PerturbationSettings(damage_fraction=0.3, damage_until=50, repair_steps=repair_steps)
    result = assess(ncrs.load_champion(name), episodes=100, seed=2, perturbations=settings)
    assert result.success.fraction >= success
    assert result.recovered >= recovered


def test_an_unknown_name_is_answered_with_those_known():
    with pytest.raises(ChampionError, match="light_chase/best"):
        ncrs.load_champion("light_chase/worst")
    with pytest.raises(SourceError, match=r"does not exist.*light_chase/best"):
        load_robot("light_chase/worst")


def test_a_damaged_card_is_recognised(tmp_path, monkeypatch):
    folder = tmp_path / "champions"
    shutil.copytree(champions_folder(), folder)
    (folder / "light_chase-best.json").write_text("{")
    monkeypatch.setattr(ncrs.runs.published, "champions_folder", lambda: folder)
    with pytest.raises(CheckpointError, match="not valid JSON"):
        ncrs.load_champion("light_chase/best")


EXPERIMENTS = {f"{task.name}/best": f"best/{task.name}" for task in PAPER_TASKS} | {
    COMPILED: "best/carry_ball_compiled"
}


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_the_experiment_is_the_champions(name):
    """The experiment has the settings that the card records, but for the number of workers."""
    register()
    overrides = [f"experiment={EXPERIMENTS[name]}"]
    with initialize_config_dir(str(ROOT / "conf"), version_base="1.3"):
        composed = asdict(train_config(compose("config", overrides), overrides))
    recorded = asdict(config_from_dict(ncrs.load_champion(name).card["config"]))
    composed["engine"]["workers"] = recorded["engine"]["workers"]
    assert composed == recorded


def test_commands_take_a_champion_by_name(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    main(["evaluate", "light_chase/best", "--episodes", "4"])
    main(["render", "light_chase/best", "--size", "64"])
    assert "100%" in capsys.readouterr().out
    written = {path.name for path in (tmp_path / "light_chase-best").iterdir()}
    assert {"evaluation.json", "body.png", "growth_and_episodes.png"} <= written
    with pytest.raises(SystemExit):
        main(["evaluate", "light_chase/worst"])
    assert "light_chase/best" in capsys.readouterr().err
