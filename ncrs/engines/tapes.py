"""Recorder of every step of the batched engine's rollout."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncrs.engines.nca_kernels import CHANGING_CHANNELS, FloatArray, IntArray
from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.dynamics import grid_center
from ncrs_envs.batched.layout import Robot, State

NOT_YET = -1


class Tapes(NamedTuple):
    """Records of P robots in E episodes; the first of T + 1 entries is the start."""

    poses: NDArray[np.float64]
    """Centre x, y and angle, ``(P, E, T + 1, 3)``."""
    balls: NDArray[np.float64]
    """``(P, E, T + 1, 2)``; zeros in tasks without a ball."""
    sensors: NDArray[np.float32]
    """``(P, E, T + 1, n * n)``."""
    gas: NDArray[np.float32]
    """Gas that led to each entry, not clipped, ``(P, E, T + 1, n * n)``."""
    rewards: NDArray[np.float64]
    """``(P, E, T + 1)``."""
    success_steps: IntArray
    """Step of the first success, or -1; ``(P, E)``."""
    changing: NDArray[np.float32]
    """Hidden and input/output channels after the last step, ``(P, E, n * n, 7)``."""


class Entry(NamedTuple):
    """Indices of an entry."""

    genome: int
    episode: int
    step: int


def make_tapes(robots: int, episodes: int, steps: int, places: int) -> Tapes:
    """Return empty tapes for grids of ``places`` cells."""
    shape = (robots, episodes, steps + 1)
    return Tapes(
        poses=np.zeros((*shape, 3)),
        balls=np.zeros((*shape, 2)),
        sensors=np.zeros((*shape, places), dtype=np.float32),
        gas=np.zeros((*shape, places), dtype=np.float32),
        rewards=np.zeros(shape),
        success_steps=np.full(shape[:2], NOT_YET, dtype=np.int64),
        changing=np.zeros((*shape[:2], places, CHANGING_CHANNELS), dtype=np.float32),
    )


@kernel
def record_poses(
    tapes: Tapes, entry: Entry, robot: Robot, state: State, observation: FloatArray
) -> None:
    """Record poses, sensor values and success after a step."""
    genome, episode, step = entry
    pose = tapes.poses[genome, episode, step]
    pose[0], pose[1] = grid_center(robot, state)
    pose[2] = state.angle
    tapes.balls[genome, episode, step, 0] = state.ball_x
    tapes.balls[genome, episode, step, 1] = state.ball_y
    tapes.sensors[genome, episode, step] = observation
    if state.success and tapes.success_steps[genome, episode] == NOT_YET:
        tapes.success_steps[genome, episode] = step


@kernel
def record_action(tapes: Tapes, entry: Entry, action: FloatArray, reward: float) -> None:
    """Record the gas that led to an entry, and its reward."""
    genome, episode, step = entry
    tapes.gas[genome, episode, step] = action
    tapes.rewards[genome, episode, step] = reward


@kernel
def record_states(tapes: Tapes, genome: int, indices: IntArray, states: FloatArray) -> None:
    """Record the automaton's states at the end of all episodes.

    Args:
        tapes: Output.
        genome: Index of the genome.
        indices: Indices of occupied cells, from ``rollout_kernels.cell_indices``.
        states: Last states, ``(occupied cells, episodes, CONTROL_LANES)``.
    """
    for place in range(len(indices)):
        if indices[place] < 0:
            continue
        for episode in range(tapes.changing.shape[1]):
            cell = states[indices[place], episode]
            tapes.changing[genome, episode, place] = cell[:CHANGING_CHANNELS]
