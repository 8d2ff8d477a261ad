"""Scenarios of populations, drawn at once: those that are drawn one by one."""

from dataclasses import replace

import numpy as np
import pytest

from ncrs.engines.batched import scenario_table
from ncrs_envs.batched import drawing
from ncrs_envs.batched.drawing import draw_recipes, draw_rows
from ncrs_envs.drawing import DrawnRows, draw_scenarios
from ncrs_envs.mirroring import ScenarioSampling
from ncrs_envs.perturbing import PerturbationSettings
from ncrs_envs.scenario import ScenarioError
from ncrs_envs.tasks import TaskSettings

KEYS = [(2, 9, genome) for genome in range(30)]
EPISODES = 7


def one_by_one(choice, settings, generation=None):
    seeds = [np.random.SeedSequence(5, spawn_key=key) for key in KEYS]
    return [list(draw_scenarios(choice, settings, seed, EPISODES, generation)) for seed in seeds]


def assert_equal(drawn, expected, grid_size):
    """Compare records, but for room that the quads of a scenario do not need."""
    ours, theirs = (scenario_table(rows, grid_size) for rows in (drawn, expected))
    assert ours.scenarios.tobytes() == theirs.scenarios.tobytes()
    counts = theirs.scenarios["quad_count"]
    for place in np.ndindex(counts.shape):
        own, other = (table.quads[place][: counts[place]] for table in (ours, theirs))
        assert own.tobytes() == other.tobytes()


@pytest.mark.parametrize("mirroring", ["none", "front_back", "all"])
@pytest.mark.parametrize(
    ("task", "grid_size", "noise"),
    [("light_chase", 5, 0.05), ("light_chase", 4, 0.35), ("carry_ball", 5, 0.2),
     ("obstacle", 5, 0.05), ("obstacle_touch", 9, 0.3)],
)  # fmt: skip
def test_rows_are_those_drawn_one_by_one(task, grid_size, noise, mirroring):
    settings, choice = TaskSettings(task, grid_size), ScenarioSampling(mirroring, noise)
    drawn, expected = draw_rows(choice, settings, 5, KEYS, EPISODES), one_by_one(choice, settings)
    walls_in_images = settings.task.has_walls and mirroring != "none"
    assert isinstance(drawn, DrawnRows) == (not walls_in_images)
    assert_equal(drawn, expected, grid_size)
    assert [list(row) for row in drawn] == expected
    assert [list(row) for row in drawn[3:5]] == expected[3:5]


def test_the_number_of_threads_changes_nothing(monkeypatch):
    settings = TaskSettings("obstacle", 3)
    monkeypatch.setattr(drawing, "_ROWS", 4)
    tables = []
    for cores in (1, 3):
        monkeypatch.setattr(drawing, "available_cores", lambda cores=cores: cores)
        tables.append(draw_rows(ScenarioSampling(), settings, 5, KEYS, EPISODES).records)
    assert tables[0].scenarios.tobytes() == tables[1].scenarios.tobytes()
    assert tables[0].quads.tobytes() == tables[1].quads.tobytes()


@pytest.mark.parametrize(
    "choice",
    [
        ScenarioSampling(curriculum="nearer", curriculum_generations=10),
        ScenarioSampling(perturbations=PerturbationSettings(damage_fraction=0.3)),
    ],
)
def test_what_changes_scenarios_is_drawn_one_by_one(choice):
    settings = TaskSettings()
    drawn = draw_rows(choice, settings, 5, KEYS, EPISODES, generation=4)
    assert not isinstance(drawn, DrawnRows)
    assert [list(row) for row in drawn] == one_by_one(choice, settings, 4)


def test_a_curriculum_that_is_over_is_drawn_at_once():
    choice = ScenarioSampling(curriculum="nearer", curriculum_generations=10)
    drawn = draw_rows(choice, TaskSettings(), 5, KEYS, EPISODES, generation=10)
    assert isinstance(drawn, DrawnRows)
    assert [list(row) for row in drawn] == one_by_one(choice, TaskSettings(), 10)


def test_long_keys_are_drawn_too():
    keys = [(2**32 + 1,), (3,)]
    drawn = draw_rows(ScenarioSampling(), TaskSettings(), 5, keys, 2)
    seed = np.random.SeedSequence(5, spawn_key=keys[0])
    assert list(drawn[0]) == list(draw_scenarios(ScenarioSampling(), TaskSettings(), seed, 2))


def test_rows_suit_the_task_that_they_were_drawn_for():
    drawn = draw_rows(ScenarioSampling(), TaskSettings(), 5, KEYS, EPISODES)
    assert drawn.suit(TaskSettings(success_radius=9.0))
    assert not drawn.suit(TaskSettings(grid_size=7))
    assert not drawn.suit(TaskSettings("obstacle"))


def test_recipes_are_drawn_at_once_if_only_their_keys_differ():
    settings, choice = TaskSettings("obstacle"), ScenarioSampling()
    rows = draw_rows(choice, settings, 5, KEYS, EPISODES)
    recipes = [row.recipe for row in rows]
    again = draw_recipes(recipes)
    assert isinstance(again, DrawnRows)
    assert again.records.scenarios.tobytes() == rows.records.scenarios.tobytes()
    mixed = draw_recipes([recipes[0], replace(recipes[1], episodes=3)])
    assert mixed == [list(rows[0]), list(rows[1])[:3]]
    for keys in ([(), ()], [(), (4,)]):  # the same row twice, and keys of other lengths
        own = [replace(recipes[0], spawn_key=key) for key in keys]
        assert [list(row) for row in draw_recipes(own)] == [recipe.draw() for recipe in own]


def test_bad_numbers_are_refused():
    with pytest.raises(ScenarioError, match="positive integer"):
        draw_rows(ScenarioSampling(), TaskSettings(), 5, KEYS, 0)
    with pytest.raises(ScenarioError, match="noise"):
        draw_rows(ScenarioSampling(noise=0.9), TaskSettings(), 5, KEYS, 2)
