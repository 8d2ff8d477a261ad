"""Episodes of many robots, recorded step by step on the batched simulator."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import BODY_CHANNEL, CONTROL_CHANNEL, NCALayout, nca_layout
from ncrs.engines.nca_kernels import pack_genomes
from ncrs.engines.rollout_kernels import (
    Rollout,
    make_outcomes,
    make_workspace,
    roll_out_population,
)
from ncrs.engines.tapes import make_tapes
from ncrs.report.robots import ReportError
from ncrs_envs.batched.layout import Scenarios
from ncrs_envs.batched.records import scenario_records, settings_record
from ncrs_envs.body import BodyGrid, Cell
from ncrs_envs.cores import available_cores
from ncrs_envs.scenario import Scenario
from ncrs_envs.tasks import MAX_EPISODE_STEPS, TaskSettings

_JOBS = 16
"""Number of parts in which robots are handed to threads."""


@dataclass(frozen=True)
class Episodes:
    """E episodes of each of P robots, T steps long; the first of T + 1 entries is the start."""

    poses: NDArray[np.float64]
    """Centre x and y in units, and angle in radians; ``(P, E, T + 1, 3)``."""
    balls: NDArray[np.float64]
    """Ball x and y in units, zeros in tasks without one; ``(P, E, T + 1, 2)``."""
    sensors: NDArray[np.float32]
    """Value in each sensor cell, else 0; ``(P, E, T + 1, n, n)``."""
    gas: NDArray[np.float32]
    """Gas in wheel cells, -1 to 1, that led to this entry; ``(P, E, T + 1, n, n)``, 0 at first."""
    rewards: NDArray[np.float64]
    """Reward of the step that led to this entry; ``(P, E, T + 1)``, 0 at first."""
    success_steps: NDArray[np.int64]
    """Step at which the episode succeeded, or -1; ``(P, E)``."""
    control_states: NDArray[np.float32]
    """All channels after the last step, ``(P, E, n, n, C)``."""

    @property
    def fitness(self) -> NDArray[np.float64]:
        """Mean reward over the steps, ``(P, E)``."""
        return np.asarray(self.rewards[..., 1:].mean(axis=-1))


def record_episodes(
    genomes: NDArray[np.float32],
    bodies: BodyGrid,
    scenarios: Sequence[Scenario],
    settings: TaskSettings,
    *,
    workers: int | None = None,
) -> Episodes:
    """Drive every robot through the same scenarios.

    Args:
        genomes: Genomes, ``(P, num_parameters)``.
        bodies: Valid cell codes, ``(P, n, n)``.
        scenarios: E placements that fit the task.
        settings: Task settings.
        workers: Number of threads; None for one per core. Results do not depend on it.

    Raises:
        ReportError: A robot's automaton turns non-finite.
    """
    count, number, n = len(bodies), len(scenarios), settings.grid_size
    layout = nca_layout(settings.task)
    _, networks = pack_genomes(genomes, layout)
    table = scenario_records(scenarios, n)
    rollout = Rollout(
        networks=networks,
        part_codes=np.array(layout.part_codes, dtype=np.int8),
        bodies=bodies,
        settings=settings_record(settings),
        scenarios=Scenarios(table.scenarios[None], table.quads[None]),
        steps=MAX_EPISODE_STEPS,
    )
    outcomes = make_outcomes(count, number, settings.task.distances)
    tapes = make_tapes(count, number, MAX_EPISODE_STEPS, n * n)

    def record(chosen: NDArray[np.int64]) -> None:
        roll_out_population(rollout, make_workspace(n, number), chosen, outcomes, tapes)

    record(np.arange(0))  # compiles, or loads from disk, before threads need it
    workers = available_cores() if workers is None else workers
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(record, np.array_split(np.arange(count), min(count, _JOBS))))
    lost = np.flatnonzero(~np.isfinite(outcomes.episode_fitness).all(axis=1))
    if len(lost):
        raise ReportError(
            f"Episodes cannot be recorded: the automaton of robots {lost.tolist()} turns "
            "non-finite; their weights are too large."
        )
    grid = (count, number, MAX_EPISODE_STEPS + 1, n, n)
    return Episodes(
        poses=tapes.poses,
        balls=tapes.balls,
        sensors=tapes.sensors.reshape(grid),
        gas=np.clip(tapes.gas, -1.0, 1.0).reshape(grid),
        rewards=tapes.rewards,
        success_steps=tapes.success_steps,
        control_states=_control_states(
            tapes.changing.reshape(count, number, n, n, -1), bodies, layout
        ),
    )


def _control_states(
    changing: NDArray[np.float32], bodies: BodyGrid, layout: NCALayout
) -> NDArray[np.float32]:
    """Return the states of all channels in control, fixed ones too: ``(P, E, n, n, C)``."""
    states = np.zeros((*changing.shape[:-1], layout.channels), dtype=np.float32)
    states[..., layout.changing_channels] = changing
    states[..., BODY_CHANNEL] = (bodies != Cell.EMPTY)[:, None]
    states[..., CONTROL_CHANNEL] = 1.0
    for channel, code in enumerate(layout.part_codes, start=layout.part_channels.start):
        states[..., channel] = (bodies == code)[:, None]
    return states
