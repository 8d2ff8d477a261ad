"""Scenarios that carry the record that draws them again."""

import pickle

import numpy as np
import pytest

from ncrs_envs.curriculum import register_curriculum
from ncrs_envs.drawing import draw_scenarios
from ncrs_envs.mirroring import ScenarioSampling
from ncrs_envs.scenario import ScenarioError
from ncrs_envs.tasks import TaskSettings

SEED = np.random.SeedSequence(11, spawn_key=(1, 2, 3))


def test_a_recipe_draws_the_same_scenarios_again():
    sampling = ScenarioSampling("front_back", 0.2)
    drawn = draw_scenarios(sampling, TaskSettings("light_chase", 9), SEED, 4)
    assert len(drawn) == 4
    assert drawn[1:3] == tuple(drawn)[1:3]
    recipe = pickle.loads(pickle.dumps(drawn.recipe))
    assert recipe == drawn.recipe
    assert recipe.draw() == list(drawn) == sampling.draw("light_chase", SEED, 4, 9)


def test_a_recipe_of_a_curriculum_draws_what_its_generation_had():
    sampling = ScenarioSampling(curriculum="nearer", curriculum_generations=10)
    drawn = [draw_scenarios(sampling, TaskSettings(), SEED, 2, index) for index in (0, 5, None)]
    assert len({str(list(row)) for row in drawn}) == 3
    for row in drawn:
        assert row.recipe.draw() == list(row)
    register_curriculum("own", lambda scenario, ease, task, grid_size: scenario)
    own = ScenarioSampling(curriculum="own", curriculum_generations=10)
    assert draw_scenarios(own, TaskSettings(), SEED, 2, 0).recipe is None


def test_other_seeds_draw_others():
    settings, sampling = TaskSettings("obstacle"), ScenarioSampling()
    drawn = [
        draw_scenarios(sampling, settings, np.random.SeedSequence(11, spawn_key=key), 2).recipe
        for key in ((1, 2, 3), (1, 2, 4), (1, 2))
    ]
    assert len(set(drawn)) == 3
    assert len({str(recipe.draw()) for recipe in drawn}) == 3


def test_bad_numbers_are_refused():
    with pytest.raises(ScenarioError, match="positive integer"):
        draw_scenarios(ScenarioSampling(), TaskSettings(), SEED, 0)
