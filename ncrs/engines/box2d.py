"""Reference engine: torch NCA and Box2D, one process per core, one genome per job."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.control import Controller, StateError
from ncrs.automaton.growth import grow
from ncrs.automaton.nca import NCA, nca_of
from ncrs.automaton.torch_settings import one_torch_thread
from ncrs.engines.arguments import GivenBodies, ScenarioRows, happens_in
from ncrs.engines.base import Engine, EvaluationInterrupted, RolloutResult, StopCheck
from ncrs.engines.perturbed_drive import Perturber, recovered
from ncrs.engines.pool import WorkerPool
from ncrs_envs.body import BodyGrid
from ncrs_envs.episode import Episode, Robot
from ncrs_envs.scenario import Scenario
from ncrs_envs.tasks import MAX_EPISODE_STEPS, TaskSettings

_BATCH = 12
"""Number of episodes that the automaton steps at a time, fixed; the paper's number of them."""
_START_LIMIT_S = 120.0
_EPISODE_LIMIT_S = 10.0
"""A worker counts as stopped after so long: hundreds of times what starting and an episode take."""


@dataclass(frozen=True)
class _Job:
    genome: NDArray[np.float32]
    settings: TaskSettings
    scenarios: Sequence[Scenario]
    body: BodyGrid | None
    """Body to drive instead of the one that the genome grows."""


@dataclass(frozen=True)
class _GenomeResult:
    body: BodyGrid
    episode_fitness: NDArray[np.float64]
    success: NDArray[np.bool_]
    crossed: NDArray[np.bool_]
    closest: NDArray[np.float64]
    recovered: NDArray[np.float64]


Recorder = Callable[[Controller, NDArray[np.float32], NDArray[np.float64]], None]
"""Function called at the start of E episodes and after each of their steps, with the controller,
and with the gas ``(E, n, n)`` and the rewards ``(E,)`` of the step, zeros at the start."""


def drive(
    nca: NCA, episodes: Sequence[Episode], record: Recorder | None = None
) -> NDArray[np.float64]:
    """Drive one robot through its episodes, all in step.

    Args:
        nca: Automaton of the robot.
        episodes: E episodes of one robot, at their start.
        record: Recorder of the start and of every step; None for no recording.

    Returns:
        Mean reward of each episode, ``(E,)``; NaN where the automaton's state became non-finite,
        which ends all episodes.
    """
    bodies = np.stack([episode.robot.body for episode in episodes])
    controller = Controller(nca, bodies, batch=_BATCH)
    is_perturbed = any(episode.scenario.is_perturbed for episode in episodes)
    perturber = Perturber(nca, episodes, controller) if is_perturbed else None
    total = np.zeros(len(episodes))
    if record is not None:
        record(controller, np.zeros(bodies.shape, dtype=np.float32), np.zeros(len(episodes)))
    for _ in range(MAX_EPISODE_STEPS):
        rests = None if perturber is None else perturber.begin_step()
        noise = None if perturber is None else perturber.noise()
        observations = np.stack([episode.observation for episode in episodes])
        try:
            actions = controller.act(observations, rests=rests, noise=noise)
        except StateError as error:
            total[list(error.robots)] = np.nan
            break
        rewards = np.array([e.step(a) for e, a in zip(episodes, actions, strict=True)])
        total += rewards
        if perturber is not None:
            perturber.end_step()
        if record is not None:
            record(controller, actions, rewards)
    return total / MAX_EPISODE_STEPS


def evaluate_genome(job: _Job) -> _GenomeResult:
    """Grow one genome's robot and drive it through its scenarios, all episodes in step."""
    with one_torch_thread():
        nca = nca_of(job.genome, job.settings.task)
        body = grow(nca, job.settings.grid_size) if job.body is None else job.body
        if not job.settings.task.is_valid(body):
            number = len(job.scenarios)
            nothing = np.zeros(number, dtype=np.bool_)
            nowhere = np.full((number, job.settings.task.distances), np.inf)
            return _GenomeResult(body, np.zeros(number), nothing, nothing, nowhere, np.ones(number))
        robot = Robot(body, job.settings.hull_density)
        episodes = [Episode(job.settings, robot, scenario) for scenario in job.scenarios]
        return _GenomeResult(
            body=body,
            episode_fitness=drive(nca, episodes),
            success=np.array([e.success for e in episodes]),
            crossed=np.array([e.crossed for e in episodes]),
            closest=np.array([e.closest for e in episodes]),
            recovered=np.array([recovered(e) for e in episodes]),
        )


class Box2DEngine(Engine):
    """Reference engine, see ``Engine``. With one worker everything runs in this process."""

    name = "box2d"

    def __init__(self, settings: TaskSettings, workers: int | None = None) -> None:
        super().__init__(settings, workers)
        self._pool = WorkerPool(self.workers)

    @property
    def worker_pids(self) -> list[int]:
        """Process ids of the running workers."""
        return self._pool.pids

    def _rollout(
        self,
        genomes: NDArray[np.float32],
        rows: ScenarioRows,
        should_stop: StopCheck,
        bodies: GivenBodies,
    ) -> RolloutResult:
        jobs = [
            _Job(
                genome,
                self.settings,
                rows[index % len(rows)],
                None if bodies is None else bodies[index],
            )
            for index, genome in enumerate(genomes)
        ]
        if self.workers == 1:
            results = []
            for job in jobs:
                if should_stop():
                    raise EvaluationInterrupted
                results.append(evaluate_genome(job))
        else:
            names = [f"genome {index}" for index in range(len(jobs))]
            limit_s = _START_LIMIT_S + _EPISODE_LIMIT_S * len(rows[0])
            results = self._pool.map(evaluate_genome, jobs, names, should_stop, limit_s)
        return RolloutResult(
            bodies=np.stack([r.body for r in results]),
            episode_fitness=np.stack([r.episode_fitness for r in results]),
            success=np.stack([r.success for r in results]),
            crossed=np.stack([r.crossed for r in results]),
            closest=np.stack([r.closest for r in results]),
            recovered=np.stack([r.recovered for r in results]) if happens_in(rows) else None,
        )

    def close(self) -> None:
        """End the worker processes; a further evaluation starts new ones."""
        self._pool.close()
