"""The robots that come with the package: that they are there, and do what their cards say."""

import shutil

import numpy as np
import pytest
from PIL import Image

import ncrs
import ncrs.champions
from ncrs.assessment import assess
from ncrs.champions import ChampionError, champions_folder, file_stem, load_any_champion
from ncrs.checkpoint import CheckpointError
from ncrs.config import register
from ncrs.settings import ConfigError, config_from_dict
from ncrs_envs.tasks import TASKS

RECIPES = ("best", "cma_es", "cma_me")
NAMES = [f"{task}/{recipe}" for task in sorted(TASKS) for recipe in RECIPES]


def test_all_are_listed():
    assert ncrs.champions() == sorted(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_champion_does_in_box2d_what_its_card_says(name):
    champion = ncrs.load_champion(name)
    published = champion.card["tests"]["box2d"]
    again = assess(champion)
    low, high = again.success.interval
    assert low <= published["success"]["share"] <= high
    error = published["fitness_standard_error"]
    assert abs(again.fitness - published["fitness"]) <= 2 * error
    assert published["success"]["episodes"] == again.success.episodes == 100


@pytest.mark.parametrize("name", NAMES)
def test_a_champion_is_complete(name):
    champion = ncrs.load_champion(name)
    assert champion.name == name
    assert champion.task.name == name.split("/")[0]
    np.testing.assert_array_equal(ncrs.grow(champion.nca, champion.task.grid_size), champion.body)
    config = config_from_dict(champion.card["config"])
    assert config.task == champion.task
    assert (
        f"task={config.task.name}" in champion.card["command"]
        or "experiment=" in (champion.card["command"])
    )
    with Image.open(champions_folder() / f"{file_stem(name)}.png") as picture:
        assert picture.width > picture.height > 100


def test_the_best_light_chaser_beats_the_papers():
    """The paper's best evolved robots reach 0.615 and 92 %."""
    published = ncrs.load_champion("light_chase/best").card["tests"]["box2d"]
    assert published["fitness"] > 0.615


def test_an_unknown_name_is_answered_with_those_known():
    with pytest.raises(ChampionError, match="light_chase/best"):
        ncrs.load_champion("light_chase/worst")
    with pytest.raises(ConfigError, match="light_chase/best"):
        load_any_champion("light_chase/worst")


def test_a_damaged_card_is_recognised(tmp_path, monkeypatch):
    folder = tmp_path / "champions"
    shutil.copytree(champions_folder(), folder)
    (folder / "light_chase-best.json").write_text("{")
    monkeypatch.setattr(ncrs.champions, "_CHECKOUT", folder)
    with pytest.raises(CheckpointError, match="not valid JSON"):
        ncrs.load_champion("light_chase/best")


def test_the_best_experiments_are_those_of_the_champions():
    """Their records name the experiment that trained them."""
    register()
    for task in TASKS:
        champion = ncrs.load_champion(f"{task}/best")
        assert f"experiment=best/{task}" in champion.card["commands"][-1]
