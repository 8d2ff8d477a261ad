"""A recorder for the batched engine's rollout: what every step of every episode was."""

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
    """What is written down of P robots in E episodes; the first of T + 1 entries is the start."""

    poses: NDArray[np.float64]
    """Centre x, y and angle, ``(P, E, T + 1, 3)``."""
    balls: NDArray[np.float64]
    """``(P, E, T + 1, 2)``; zeros in tasks without a ball."""
    sensors: NDArray[np.float32]
    """``(P, E, T + 1, n * n)``."""
    gas: NDArray[np.float32]
    """What led to each entry, not clipped, ``(P, E, T + 1, n * n)``."""
    rewards: NDArray[np.float64]
    """``(P, E, T + 1)``."""
    success_steps: IntArray
    """The step of the first success, or -1; ``(P, E)``."""
    changing: NDArray[np.float32]
    """Hidden and input/output channels after the last step, ``(P, E, n * n, 7)``."""


class Entry(NamedTuple):
    """Where an entry belongs."""

    genome: int
    episode: int
    step: int


def make_tapes(robots: int, episodes: int, steps: int, places: int) -> Tapes:
    """Empty tapes for grids of ``places`` cells."""
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
    """Write down poses, sensor values and success after a step."""
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
    """Write down the gas that led to an entry, and its reward."""
    genome, episode, step = entry
    tapes.gas[genome, episode, step] = action
    tapes.rewards[genome, episode, step] = reward


@kernel
def record_states(tapes: Tapes, genome: int, numbers: IntArray, states: FloatArray) -> None:
    """Write down the automaton's states at the end of all episodes.

    Args:
        tapes: the tapes.
        genome: the robot's index.
        numbers: see ``rollout_kernels.cell_numbers``.
        states: ``[occupied cell][episode][CONTROL_LANES]``.
    """
    for place in range(len(numbers)):
        if numbers[place] < 0:
            continue
        for episode in range(tapes.changing.shape[1]):
            cell = states[numbers[place], episode]
            tapes.changing[genome, episode, place] = cell[:CHANGING_CHANNELS]
