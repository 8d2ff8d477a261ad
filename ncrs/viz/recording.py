"""Episodes of one robot on Box2D as scenes and NCA states, for pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.control import Controller, StateError
from ncrs.automaton.torch_settings import one_torch_thread
from ncrs.engines.box2d import drive
from ncrs.runs.robot import EvolvedRobot
from ncrs_envs.episode import Episode, Robot
from ncrs_envs.mirroring import ScenarioSampling
from ncrs_envs.perturbing import NO_PERTURBATIONS, PerturbationSettings
from ncrs_envs.rendering import Scene
from ncrs_envs.scenario import Scenario


@dataclass(frozen=True, eq=False)
class Recording:
    """One episode, T steps."""

    scenes: Sequence[Scene]
    """Scenes at the start and after every step; T + 1 of them."""
    states: NDArray[np.float32]
    """NCA states at the same times, ``(T + 1, n, n, C)``."""
    rewards: NDArray[np.float64]
    """Reward of every step, ``(T,)``."""
    fitness: float
    """Mean reward, bit-identical to the ``box2d`` engine's for the same set of scenarios."""
    scenario: Scenario

    @property
    def success(self) -> bool:
        """True if the task was solved at any time."""
        return self.scenes[-1].success


class _Recorder:
    """Recorder of every moment of E episodes."""

    def __init__(self, episodes: Sequence[Episode]) -> None:
        self._episodes = episodes
        self._paths: list[list[tuple[float, float]]] = [[] for _ in episodes]
        self.scenes: list[list[Scene]] = [[] for _ in episodes]
        self.states: list[NDArray[np.float32]] = []
        self.rewards: list[NDArray[np.float64]] = []

    def __call__(
        self, controller: Controller, gas: NDArray[np.float32], rewards: NDArray[np.float64]
    ) -> None:
        self.states.append(controller.states)
        self.rewards.append(rewards)
        for index, episode in enumerate(self._episodes):
            self._paths[index].append(episode.pose[:2])
            self.scenes[index].append(episode.scene(gas[index], self._paths[index]))


def record(robot: EvolvedRobot, scenarios: Sequence[Scenario]) -> list[Recording]:
    """Drive a robot through scenarios on Box2D, all in step, and record every moment.

    Raises:
        ScenarioError: If a scenario does not fit the task.
        StateError: If the automaton's state becomes non-finite.
    """
    for scenario in scenarios:
        scenario.check(robot.task.task, robot.task.grid_size)
    machine = Robot(robot.body, robot.task.hull_density)
    episodes = [Episode(robot.task, machine, scenario) for scenario in scenarios]
    recorder = _Recorder(episodes)
    with one_torch_thread():
        fitness = drive(robot.nca, episodes, recorder)
    lost = np.flatnonzero(np.isnan(fitness))
    if len(lost):
        raise StateError(lost.tolist())
    states, rewards = np.stack(recorder.states, axis=1), np.stack(recorder.rewards[1:], axis=1)
    return [
        Recording(recorder.scenes[index], states[index], rewards[index], float(value), scenario)
        for index, (value, scenario) in enumerate(zip(fitness, scenarios, strict=True))
    ]


def record_episodes(
    robot: EvolvedRobot,
    episodes: int,
    seed: int,
    perturbations: PerturbationSettings = NO_PERTURBATIONS,
) -> list[Recording]:
    """Drive a robot through ``episodes`` scenarios drawn from ``seed``; the regions take turns.

    Raises:
        ScenarioError: If ``episodes`` is not a positive integer.
        StateError: If the automaton's state becomes non-finite.
    """
    settings = robot.task
    sampling = ScenarioSampling(perturbations=perturbations)
    return record(robot, sampling.draw(settings.task, seed, episodes, settings.grid_size))
