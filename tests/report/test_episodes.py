"""Recorded episodes are the evaluated ones."""

import numpy as np
import pytest

from ncrs import load_champion
from ncrs.automaton.channels import nca_layout
from ncrs.engines.batched import BatchedEngine
from ncrs.report.episodes import record_episodes
from ncrs.report.robots import ReportError
from ncrs_envs.scenario import sample_scenarios
from ncrs_envs.tasks import TaskSettings


@pytest.fixture(params=["light_chase", "obstacle", "carry_ball"])
def task(request) -> str:
    return request.param


def _genomes(task: str, count: int) -> np.ndarray:
    """The published champion and genomes around it."""
    champion = load_champion(f"{task}/best").genome
    noise = np.random.default_rng(2).normal(0.0, 0.005, (count, champion.size))
    noise[0] = 0.0
    return (champion + noise).astype(np.float32)


def test_a_recorded_episode_earns_what_was_evaluated(task):
    """Bit for bit; rewards are summed step by step, as the rollout does."""
    settings = TaskSettings(task)
    genomes = nca_layout(task).check_genomes(_genomes(task, 6))
    scenarios = sample_scenarios(task, 5, 7)
    with BatchedEngine(settings, 2) as engine:
        evaluated = engine.evaluate(genomes, scenarios)
    valid = np.flatnonzero(evaluated.valid)
    assert len(valid) >= 3
    recorded = record_episodes(genomes[valid], evaluated.bodies[valid], scenarios, settings)
    summed = np.add.accumulate(recorded.rewards[..., 1:], axis=-1)[..., -1]
    steps = recorded.rewards.shape[-1] - 1
    np.testing.assert_array_equal(summed / steps, evaluated.episode_fitness[valid])
    np.testing.assert_allclose(recorded.fitness, evaluated.episode_fitness[valid], rtol=1e-14)
    np.testing.assert_array_equal(recorded.success_steps >= 0, evaluated.success[valid])
    assert np.ptp(recorded.fitness) > 0.01
    if task == "obstacle":
        crossed = (recorded.poses[..., 1:, 1] > 0.0).any(axis=-1)
        np.testing.assert_array_equal(crossed, evaluated.crossed[valid])


def test_weights_that_are_too_large_are_reported():
    settings = TaskSettings("light_chase")
    champion = load_champion("light_chase/best")
    genomes = np.stack([champion.genome, 1e20 * champion.genome]).astype(np.float32)
    bodies = np.stack([champion.body, champion.body])
    with pytest.raises(ReportError, match=r"robots \[1\] turns non-finite"):
        record_episodes(genomes, bodies, sample_scenarios("light_chase", 0, 2), settings)
