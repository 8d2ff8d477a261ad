"""Requirements on the batched engine alone; those on every engine are in the contract tests."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("numba")

from ncrs.engines import batched
from ncrs.engines.base import EvaluationInterrupted, NonFiniteStateWarning
from ncrs.engines.batched import BatchedEngine
from ncrs.engines.box2d import Box2DEngine
from ncrs.engines.nca_kernels import EPISODE_TILE
from ncrs_envs.scenario import sample_scenarios
from ncrs_envs.tasks import TaskSettings


@pytest.fixture
def settings():
    return TaskSettings("light_chase")


def test_episodes_that_do_not_fill_a_tile_change_nothing(settings, full_genome):
    scenarios = sample_scenarios("light_chase", 2, 2 * EPISODE_TILE + 1)
    with BatchedEngine(settings, 1) as engine:
        together = engine.evaluate(full_genome, scenarios).episode_fitness[0]
        alone = [engine.evaluate(full_genome, [s]).episode_fitness[0, 0] for s in scenarios]
    np.testing.assert_array_equal(together, alone)
    assert np.ptp(together) > 0.01


def test_follows_box2d_episode_by_episode(settings, genomes, full_genome):
    vectors = full_genome + 0.1 * genomes(12, seed=4)
    scenarios = sample_scenarios("light_chase", 3, 4)
    with BatchedEngine(settings, 2) as fast, Box2DEngine(settings, 1) as reference:
        result = fast.evaluate(vectors, scenarios)
        expected = reference.evaluate(vectors, scenarios)
    np.testing.assert_array_equal(result.bodies, expected.bodies)
    np.testing.assert_array_equal(result.measures, expected.measures)
    assert expected.valid.sum() >= 5
    # Float32 noise in the NCA, amplified over a hundred steps of feedback.
    np.testing.assert_allclose(result.episode_fitness, expected.episode_fitness, atol=2e-3)
    assert abs((result.episode_fitness - expected.episode_fitness).mean()) < 1e-4


def test_growth_that_turns_non_finite_is_reported_and_gives_no_body(settings, genomes, full_genome):
    vectors = np.stack([genomes(1)[0] * 1e20, full_genome])
    scenarios = sample_scenarios("light_chase", 0, 2)
    with (
        BatchedEngine(settings, 2) as engine,
        pytest.warns(NonFiniteStateWarning, match="genome 0 .* growth"),
    ):
        result = engine.evaluate(vectors, scenarios)
    np.testing.assert_array_equal(result.valid, [False, True])
    np.testing.assert_array_equal(result.bodies[0], 0)
    assert result.fitness[0] == 0.0
    with BatchedEngine(settings, 2) as engine:
        alone = engine.evaluate(full_genome, scenarios)
    np.testing.assert_array_equal(result.episode_fitness[1], alone.episode_fitness[0])


def test_an_interrupt_takes_effect_before_the_last_genome(settings, full_genome, monkeypatch):
    rolled_out = []
    roll_out = batched.roll_out_population

    def counted(*arguments):
        rolled_out.append(1)
        roll_out(*arguments)

    monkeypatch.setattr(batched, "roll_out_population", counted)
    scenarios = sample_scenarios("light_chase", 0, 60)
    with BatchedEngine(settings, 1) as engine, pytest.raises(EvaluationInterrupted):
        engine.evaluate(np.stack([full_genome] * 300), scenarios, lambda: len(rolled_out) > 2)
    assert 2 < len(rolled_out) < 150
