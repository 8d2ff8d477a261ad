"""What travels: plain records and arrays, and the functions of registered tasks."""

import dataclasses
import pickle

import numpy as np
import pytest

import ncrs_envs
from ncrs.engines.base import EngineSettingError, RolloutResult
from ncrs.engines.cluster.records import (
    Shard,
    differing,
    joined,
    make_setup,
    rows_of,
    travelling_rows,
)
from ncrs_envs.drawing import draw_scenarios
from ncrs_envs.mirroring import ScenarioSampling
from ncrs_envs.perturbing import PerturbationSettings
from ncrs_envs.scenario import sample_scenarios
from ncrs_envs.tasks import LIGHT_CHASE, TASKS, Task, TaskSettings

SEED = np.random.SeedSequence(7, spawn_key=(1, 3))


def result(values):
    fitness = np.array(values, dtype=np.float64)[:, None]
    flags = np.zeros(fitness.shape, dtype=bool)
    bodies = np.zeros((len(fitness), 3, 3), dtype=np.int8)
    return RolloutResult(bodies, fitness, flags, flags, fitness[..., None], flags[:, 0])


def test_a_generation_of_the_papers_size_is_two_megabytes():
    genomes = np.zeros((112, 4572), dtype=np.float32)
    settings = TaskSettings("obstacle")
    drawn = draw_scenarios(ScenarioSampling(), settings, SEED, 12)
    shard = Shard(genomes, travelling_rows([drawn]), make_setup(settings, "auto", None))
    size = len(pickle.dumps(shard))
    assert 0 < size - genomes.nbytes < 1000  # the seed, not the walls
    assert genomes.nbytes == pytest.approx(2.05e6, rel=0.01)


@pytest.mark.parametrize("task", ["light_chase", "obstacle", "carry_ball"])
def test_scenarios_are_the_same_wherever_they_are_drawn(task):
    settings = TaskSettings(task, grid_size=7)
    sampling = ScenarioSampling("all", 0.1)
    drawn = draw_scenarios(sampling, settings, SEED, 6)
    plain = sample_scenarios(task, 3, 6, 7)
    rows = pickle.loads(pickle.dumps(travelling_rows([drawn, plain])))
    shard = Shard(np.zeros((2, 1), dtype=np.float32), rows, make_setup(settings, "auto", None))
    assert [list(row) for row in shard.scenario_rows()] == [list(drawn), plain]
    assert list(drawn) == sampling.draw(task, SEED, 6, 7)


def test_damage_travels_as_its_recipe():
    settings = PerturbationSettings(damage_fraction=0.3, damage_until=50, repair_steps=10)
    sampling = ScenarioSampling("front_back", perturbations=settings)
    drawn = draw_scenarios(sampling, TaskSettings(), SEED, 6, generation=4)
    (recipe,) = pickle.loads(pickle.dumps(travelling_rows([drawn])))
    assert recipe.draw() == list(drawn)
    assert all(scenario.damage is not None for scenario in drawn)


def test_results_with_and_without_recovery_join():
    damaged = dataclasses.replace(result([1.0]), recovered=np.array([[0.5]]))
    np.testing.assert_array_equal(joined([result([0.0]), damaged]).recovered, [[1.0], [0.5]])
    assert rows_of(damaged, slice(1)).recovered == [[0.5]]


def test_samplings_of_ones_own_travel_as_placements(monkeypatch):
    from ncrs_envs import mirroring

    monkeypatch.setattr(mirroring.SAMPLINGS, "_entries", dict(mirroring.SAMPLINGS._entries))
    ncrs_envs.register_sampling("mine", sample_scenarios)
    drawn = draw_scenarios(ScenarioSampling(kind="mine"), TaskSettings(), SEED, 2)
    assert travelling_rows([drawn]) == [tuple(drawn)]


def test_a_registered_task_need_not_be_known_where_it_arrives(monkeypatch):
    entries = dict(TASKS._entries)
    monkeypatch.setattr(TASKS, "_entries", dict(entries))
    factor = 3.0
    own = Task(
        "lab", "Lab-v0", 5.0, LIGHT_CHASE.required_parts, has_light=True,
        place=sample_scenarios, reward=lambda episode: factor * episode,
    )  # fmt: skip
    ncrs_envs.register_task(own)
    setup = pickle.loads(pickle.dumps(make_setup(TaskSettings("lab", 7), "auto", 2)))
    monkeypatch.setattr(TASKS, "_entries", entries)
    settings = setup.settings()
    assert (settings.name, settings.grid_size, settings.radius) == ("lab", 7, 5.0)
    assert settings.task.reward(2.0) == 6.0
    assert settings.task.place is None  # scenarios are drawn before they travel
    assert setup.definition is not None
    assert make_setup(TaskSettings(), "auto", 2).definition is None
    assert make_setup(settings, "auto", 2).settings().task.reward(2.0) == 6.0


def test_a_task_whose_module_is_missing_is_named():
    missing = b"cno_such_lab\nreward\n."  # a pickle that refers to a function there
    setup = make_setup(TaskSettings(), "auto", None)
    object.__setattr__(setup, "definition", missing)
    with pytest.raises(EngineSettingError, match=r"load the task 'light_chase': No module named"):
        setup.settings()


def test_parts_join_in_order_and_split_again():
    whole = joined([result([0.0, 1.0]), result([2.0])])
    np.testing.assert_array_equal(whole.episode_fitness[:, 0], [0.0, 1.0, 2.0])
    np.testing.assert_array_equal(rows_of(whole, slice(1, 3)).episode_fitness[:, 0], [1.0, 2.0])


def test_any_bit_counts_as_a_difference():
    same = result([0.5, np.nan, 0.0])
    np.testing.assert_array_equal(differing(same, result([0.5, np.nan, 0.0])), [])
    np.testing.assert_array_equal(differing(same, result([0.5 + 2**-53, np.nan, -0.0])), [0, 2])
