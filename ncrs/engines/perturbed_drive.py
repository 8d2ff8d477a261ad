"""Repair and noise on Box2D: what a robot does besides acting, in episodes of one genome."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import STEPS_PER_ACTION
from ncrs.automaton.control import Controller
from ncrs.automaton.growth import regrow
from ncrs.automaton.nca import NCA
from ncrs_envs.body import BodyGrid
from ncrs_envs.episode import Episode
from ncrs_envs.noise import STATE_NOISE, normal_noise


class Perturber:
    """Bodies, repairs and state noise of E episodes of one genome; all in step.

    Args:
        nca: Automaton of the robot.
        episodes: The episodes, at their start.
        controller: Controller of the robots.
    """

    def __init__(self, nca: NCA, episodes: Sequence[Episode], controller: Controller) -> None:
        self._nca = nca
        self._episodes = episodes
        self._controller = controller
        self._bodies: list[BodyGrid] = [episode.robot.body for episode in episodes]
        self._resting = [0] * len(episodes)
        self._acted = [0] * len(episodes)

    def begin_step(self) -> NDArray[np.bool_]:
        """Begin the repairs that are due, and return the mask of the robots that rest, ``(E,)``."""
        for index, episode in enumerate(self._episodes):
            repair, damage = episode.scenario.repair, episode.scenario.damage
            if repair is None:
                continue
            damaged = damage is not None and damage.step == episode.steps
            if damaged and not repair.every:
                self._resting[index] = repair.duration
            if repair.every and self._acted[index] >= repair.every:
                self._resting[index], self._acted[index] = repair.duration, 0
        self._follow()
        rests = np.array([resting > 0 for resting in self._resting])
        self._acted = [
            acted + (not rest) for acted, rest in zip(self._acted, rests.tolist(), strict=True)
        ]
        return rests

    def end_step(self) -> None:
        """Regrow the robots whose repair ends with this step."""
        for index, episode in enumerate(self._episodes):
            if not self._resting[index]:
                continue
            self._resting[index] -= 1
            repair = episode.scenario.repair
            if not self._resting[index] and repair is not None:
                episode.exchange(regrow(self._nca, episode.robot.body, repair.steps))
        self._follow()

    def _follow(self) -> None:
        """Let the controller go on in the bodies that the robots have now."""
        bodies = [episode.robot.body for episode in self._episodes]
        if any(now is not before for now, before in zip(bodies, self._bodies, strict=True)):
            self._bodies = bodies
            self._controller.exchange(np.stack(bodies))

    def noise(self) -> NDArray[np.float32] | None:
        """Draw the state noise of an action, ``(2, E, channels, n, n)``; None for no noise."""
        noises = [episode.scenario.noise for episode in self._episodes]
        if not any(noise is not None and noise.state for noise in noises):
            return None
        layout = self._nca.layout
        n = len(self._bodies[0])
        lanes = layout.channels - layout.changing_channels.start
        drawn = np.zeros((STEPS_PER_ACTION, len(noises), lanes, n, n), dtype=np.float32)
        counters = np.arange(n * n * lanes).reshape(n, n, lanes).transpose(2, 0, 1)
        for index, noise in enumerate(noises):
            if noise is None:
                continue
            for half in range(STEPS_PER_ACTION):
                moment = STEPS_PER_ACTION * self._episodes[index].steps + half
                values = normal_noise(noise.seed, STATE_NOISE, moment * counters.size + counters)
                drawn[half, index] = noise.state * values
        return drawn


def recovered(episode: Episode) -> float:
    """Return the fraction of the lost modules that are back; 1 if none was lost."""
    lost = episode.hit != episode.damaged
    return float((episode.robot.body == episode.hit)[lost].mean()) if lost.any() else 1.0
