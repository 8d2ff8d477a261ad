"""The robots of a vector environment: their bodies, and what happens to them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.episode_batch import EpisodeBatch
from ncrs_envs.batched.scenario_table import Indices
from ncrs_envs.body import Cell, sensor_mask, wheel_mask
from ncrs_envs.noise import SENSOR_NOISE, normal_noise
from ncrs_envs.scenario import Scenario


class EnvRobots:
    """Robots of the environments, whole or damaged.

    Args:
        batch: Episodes of the environments.
        grid_size: Side of the body grid.

    Attributes:
        bodies: Present bodies, int8 ``(count, n, n)``.
    """

    def __init__(self, batch: EpisodeBatch, grid_size: int) -> None:
        self._batch = batch
        self.bodies = np.zeros((batch.count, grid_size, grid_size), dtype=np.int8)
        self._sensor_masks = np.zeros(self.bodies.shape, dtype=np.bool_)
        self._wheel_masks = np.zeros(self.bodies.shape, dtype=np.bool_)
        self._perturbed: dict[int, Scenario] = {}
        self._whole: dict[int, NDArray[np.int8]] = {}
        self._failed: dict[int, NDArray[np.bool_]] = {}

    @property
    def whole_bodies(self) -> NDArray[np.int8]:
        """Bodies before any damage, int8 ``(count, n, n)``, a copy."""
        bodies = self.bodies.copy()
        for env, whole in self._whole.items():
            bodies[env] = whole
        return bodies

    def put(self, envs: Indices, bodies: NDArray[np.int8]) -> None:
        """Set bodies, ``(len(envs), n, n)`` or ``(1, n, n)``, for these and later episodes."""
        self._batch.set_bodies(envs, bodies)
        self._note(envs, bodies)

    def _note(self, envs: Indices, bodies: NDArray[np.int8]) -> None:
        self.bodies[envs] = bodies
        self._sensor_masks[envs] = sensor_mask(bodies)
        self._wheel_masks[envs] = wheel_mask(bodies)

    def end(self, envs: Indices) -> None:
        """End episodes: damaged robots have their whole bodies again."""
        if not self._perturbed:
            return
        for env in envs.tolist():
            self._perturbed.pop(env, None)
            self._failed.pop(env, None)
            if env in self._whole:
                self.put(np.array([env]), self._whole.pop(env)[None])

    def begin(self, envs: Indices) -> None:
        """Begin episodes in the scenarios that the batch has for them."""
        for env in envs.tolist():
            scenario = self._batch.scenarios.perturbed(env)
            if scenario is None:
                continue
            self._perturbed[env] = scenario
            if scenario.failure is not None:
                self._failed[env] = scenario.failure.failed(self.bodies[env])

    def damage(self, envs: Indices, steps: NDArray[np.int64]) -> None:
        """Damage the robots for which it is time; ``steps`` are those done, ``(count,)``."""
        if not self._perturbed:
            return
        for env in envs.tolist():
            damage = self._perturbed[env].damage if env in self._perturbed else None
            if damage is None or damage.step != steps[env]:
                continue
            self._whole[env] = self.bodies[env].copy()
            left = damage.left(self.bodies[env])[None]
            self._batch.exchange_bodies(np.array([env]), left)
            self._note(np.array([env]), left)

    def silence(self, actions: NDArray[np.float32], steps: NDArray[np.int64]) -> None:
        """Set the gas of failed wheels to 0 in actions, ``(count, n, n)``."""
        for env, failed in self._failed.items():
            failure = self._perturbed[env].failure
            if failure is not None and steps[env] >= failure.step:
                actions[env][failed] = 0.0

    def observations(self, steps: NDArray[np.int64]) -> NDArray[np.float32]:
        """Return the sensor values with their noise, ``(count, n, n)``, a copy."""
        observations = self._batch.observations.reshape(self.bodies.shape).copy()
        for env, scenario in self._perturbed.items():
            noise = scenario.noise
            if noise is None or not noise.sensor:
                continue
            is_touch = self.bodies[env] == Cell.TOUCH_SENSOR
            cells = np.flatnonzero(self._sensor_masks[env] & ~is_touch)
            counters = steps[env] * self.bodies[env].size + cells
            drawn = noise.sensor * normal_noise(noise.seed, SENSOR_NOISE, counters)
            values = observations[env].reshape(-1)
            values[cells] = np.clip(values[cells] + drawn, 0.0, 1.0)
        return observations

    def infos(self) -> dict[str, NDArray[Any]]:
        """Return the entries of the environments' infos about bodies, as new arrays."""
        return {
            "body": self.bodies.copy(),
            "sensor_mask": self._sensor_masks.copy(),
            "wheel_mask": self._wheel_masks.copy(),
        }
