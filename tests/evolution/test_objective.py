import dataclasses

import numpy as np
import pytest

from ncrs import evaluate
from ncrs.evolution.objective import (
    Objective,
    ObjectiveError,
    check_objective,
    register_objective,
)
from ncrs_envs import Scenario
from ncrs_envs.tasks import TaskSettings


def test_bonuses_for_success_and_for_coming_near(full_genome, genomes):
    near = Scenario((0.0, 0.0), light=(0.0, 15.0))
    far = Scenario((0.0, 0.0), light=(50.0, -50.0))
    weights = np.concatenate([full_genome[None], genomes(1, 4572, sigma=1e-6)])
    result = evaluate(weights, "light_chase", scenarios=[near, far])
    np.testing.assert_array_equal(result.success, [[True, False], [False, False]])
    settings = TaskSettings("light_chase")
    np.testing.assert_array_equal(Objective(settings)(result), result.fitness)
    np.testing.assert_allclose(
        Objective(settings, success_bonus=0.5)(result) - result.fitness, [0.25, 0.0]
    )
    scores = np.exp(-result.closest[0, :, 0] / 60.0)
    np.testing.assert_allclose(
        Objective(settings, approach_bonus=2.0)(result) - result.fitness, [scores.sum(), 0.0]
    )


def test_a_bonus_for_what_grew_back(full_genome, genomes):
    weights = np.concatenate([full_genome[None], genomes(1, 4572, sigma=1e-6)])
    result = dataclasses.replace(
        evaluate(weights, "light_chase", episodes=2), recovered=np.array([[1.0, 0.5], [1.0, 1.0]])
    )
    objective = Objective(TaskSettings("light_chase"), recovery_bonus=2.0)
    np.testing.assert_allclose(objective(result) - result.fitness, [1.5, 0.0])


def test_coming_near_counts_for_ball_and_target_alike():
    settings = TaskSettings("carry_ball")
    result = dataclasses.replace(
        evaluate(np.zeros((1, 4873)), "carry_ball", episodes=1), closest=np.array([[[30.0, 60.0]]])
    )
    bonus = Objective(settings, approach_bonus=1.0)(result) - result.fitness
    np.testing.assert_allclose(bonus, (np.exp(-0.5) + np.exp(-1.0)) / 2)


def test_soft_success_counts_failures_by_how_near_they_came(full_genome):
    settings = TaskSettings("light_chase")
    near, far = Scenario((0.0, 0.0), light=(0.0, 15.0)), Scenario((0.0, 0.0), light=(50.0, -50.0))
    weights = np.stack([full_genome, np.zeros_like(full_genome)])
    result = evaluate(weights, "light_chase", scenarios=[near, far])
    missed = result.closest[0, 1, 0] - 20.0
    assert missed > 10
    found = Objective(settings, name="soft_success")(result)
    expected = (1 + 0.4 + 0.4 * np.exp(-missed / 12)) / 2
    np.testing.assert_allclose(found, [expected, result.fitness[1]])  # zeros grow no robot
    lost = dataclasses.replace(result, fitness=np.array([np.nan, 0.0]))
    assert np.isnan(Objective(settings, name="soft_success")(lost)[0])


def test_unknown_and_malformed_objectives_are_refused():
    with pytest.raises(ObjectiveError, match=r"one of \['fitness', 'soft_success'"):
        check_objective("speed")
    register_objective("first", lambda evaluation, settings: evaluation.fitness[:1])
    result = evaluate(np.zeros((2, 4572)), "light_chase", episodes=1)
    with pytest.raises(ObjectiveError, match=r"'first' must return .* shape \(2,\), got \(1,\)"):
        Objective(TaskSettings(), name="first")(result)
