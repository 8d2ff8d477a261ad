"""The same wrappers for vector environments: the batched simulator, or Gymnasium's own.

``FixedBodyView(gymnasium.make_vec("NCRS-LightChase-v0", 512))``. Bodies may differ between the
environments. All autoreset modes are understood.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from ncrs_envs.body import BodyError, Cell, sensor_mask, wheel_mask
from ncrs_envs.interface import check_action
from ncrs_envs.wrappers.signals import (
    CHANGE,
    CONTRAST,
    PROGRESS,
    SensorContrast,
    ViewError,
    require_vectors,
    sides,
)

Values = NDArray[np.float32]
Flags = NDArray[np.bool_]
Step = tuple[Any, Any, Any, Any, dict[str, Any]]

if TYPE_CHECKING:
    _Envs = VectorEnv[Any, Any, Any]
    _Wrapper = VectorWrapper[Any, Any, Any, Any, Any]
else:
    _Envs, _Wrapper = VectorEnv, VectorWrapper


def bodies_of(envs: _Envs) -> NDArray[np.int8]:
    """Present bodies of all environments, int8 ``(N, n, n)``."""
    base: Any = envs.unwrapped
    return np.asarray(base.bodies if hasattr(base, "bodies") else base.get_attr("body"))


def whole_bodies_of(envs: _Envs) -> NDArray[np.int8]:
    """Bodies of all environments before any damage, int8 ``(N, n, n)``."""
    base: Any = envs.unwrapped
    has_all = hasattr(base, "whole_bodies")
    return np.asarray(base.whole_bodies if has_all else base.get_attr("whole_body"))


def check_on_cpu(envs: _Envs) -> None:
    """Raise ``ViewError`` for environments on a GPU."""
    device = str(getattr(envs.unwrapped, "device", "cpu"))
    if device.startswith("cuda"):
        raise ViewError(
            f"This wrapper computes with numpy, and these environments are on {device}: make them "
            "without device, or compute with their tensors."
        )


class _View(_Wrapper):
    """A wrapper that knows which environments have just begun a new episode."""

    def __init__(self, envs: _Envs) -> None:
        check_on_cpu(envs)
        super().__init__(envs)
        self._was_done = np.zeros(self.num_envs, dtype=np.bool_)

    def _set_observation(self, space: gymnasium.Space[Any]) -> None:
        self.single_observation_space = space
        self.observation_space = batch_space(space, self.num_envs)

    def _set_action(self, space: gymnasium.Space[Any]) -> None:
        self.single_action_space = space
        self.action_space = batch_space(space, self.num_envs)

    def _begun(self, terminated: Flags, truncated: Flags) -> Flags:
        """Mask of the environments whose observation in this step is the first of an episode."""
        done = terminated | truncated
        begun = self._was_done
        if self.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP:
            begun = done
        self._was_done = done
        return begun

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start episodes; options as in the environments."""
        # Gymnasium takes the mask out of the options that it gets.
        given = options.copy() if isinstance(options, dict) else options
        observations, infos = self.env.reset(seed=seed, options=given)
        self._was_done[_is_reset(options, self.num_envs)] = False
        return observations, infos


def _is_reset(options: dict[str, Any] | None, count: int) -> Flags:
    mask = (options or {}).get("reset_mask")
    return np.ones(count, dtype=np.bool_) if mask is None else np.asarray(mask)


def _of_final(infos: dict[str, Any], change: Any) -> None:
    """Apply ``change(env, observation)`` to the last observations of episodes that have ended."""
    final = infos.get("final_obs")
    if final is not None:
        for env in np.flatnonzero(infos["_final_obs"]):
            final[env] = change(env, final[env])


def _final_body(infos: dict[str, Any], env: int) -> NDArray[np.int8]:
    """Body at the end of an episode that has ended in this step, a copy."""
    body: NDArray[np.int8] = infos["final_info"]["body"][env].copy()
    return body


class FixedBodyView(_View):
    """Sensors and wheels of bodies as vectors, in row order.

    Observations are ``Box(0, 1, (N, sensors), float32)``, actions ``Box(-1, 1, (N, wheels),
    float32)``. Bodies may differ, but not in how many sensors and wheels they have. Lost
    ones keep their places: a lost sensor reads 0, the gas of a lost wheel is ignored.

    Args:
        envs: vector environments of this suite.

    Raises:
        BodyError: bodies with different numbers of sensors or wheels.
    """

    def __init__(self, envs: _Envs) -> None:
        super().__init__(envs)
        bodies = whole_bodies_of(envs)
        counts = _counts(bodies)
        if len(np.unique(counts, axis=0)) > 1:
            raise BodyError(
                "FixedBodyView needs bodies with equally many sensors and wheels, got (sensors, "
                f"wheels) from {counts.min(axis=0).tolist()} to {counts.max(axis=0).tolist()}; use "
                "BodyConditionedView."
            )
        self._sensor_count, self._wheel_count = counts[0].tolist()
        self._set_bodies(bodies)
        box = gymnasium.spaces.Box
        self._set_observation(box(0.0, 1.0, (self._sensor_count,), np.float32))
        self._set_action(box(-1.0, 1.0, (self._wheel_count,), np.float32))

    def _set_bodies(self, bodies: NDArray[np.int8]) -> None:
        self._sensors, self._wheels = sensor_mask(bodies), wheel_mask(bodies)

    def _vectors(self, grids: Values) -> Values:
        return grids[self._sensors].reshape(self.num_envs, self._sensor_count)

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[Values, dict[str, Any]]:
        """Start episodes; options as in the environments.

        Raises:
            BodyError: ``options["body"]`` has another number of sensors or wheels.
        """
        before = whole_bodies_of(self.env)
        grids, infos = super().reset(seed=seed, options=options)
        bodies = whole_bodies_of(self.env)
        counts = _counts(bodies)
        wrong = np.flatnonzero((counts != (self._sensor_count, self._wheel_count)).any(axis=1))
        if len(wrong):
            self._restore(before, _is_reset(options, self.num_envs))
            raise BodyError(
                f"This view is of bodies with {self._sensor_count} sensors and "
                f"{self._wheel_count} wheels, got one with {counts[wrong[0]].tolist()} for "
                f"environment {wrong[0]}; the bodies are as they were, in new episodes."
            )
        self._set_bodies(bodies)
        return self._vectors(grids), infos

    def _restore(self, bodies: NDArray[np.int8], mask: Flags) -> None:
        for body in np.unique(bodies[mask], axis=0):
            same = mask & (bodies == body).all(axis=(1, 2))
            self.env.reset(options={"body": body, "reset_mask": same})

    def step(self, actions: Values) -> Step:
        """Advance one control step with one gas value per wheel, shape ``(N, wheels)``.

        Raises:
            ActionError: wrong shape, or values that are not finite.
        """
        shape = (self.num_envs, self._wheel_count)
        gas = check_action(actions, shape, "one gas value per wheel")
        grids = np.zeros(self._wheels.shape, dtype=np.float32)
        grids[self._wheels] = gas.ravel()
        observations, rewards, terminated, truncated, infos = self.env.step(grids)
        _of_final(infos, lambda env, grid: grid[self._sensors[env]])
        return self._vectors(observations), rewards, terminated, truncated, infos


def _counts(bodies: NDArray[np.int8]) -> NDArray[np.int64]:
    masks = (sensor_mask(bodies), wheel_mask(bodies))
    return np.stack([mask.sum(axis=(1, 2)) for mask in masks], axis=1)


class BodyConditionedView(_View):
    """Observations that also show the bodies, for one agent that drives many.

    Observations are a Dict of ``sensors``, the environments' own grids ``(N, n, n)``, and ``body``,
    int8 ``(N, n, n)`` of cell codes. Actions stay grids.

    Args:
        envs: vector environments of this suite.
    """

    def __init__(self, envs: _Envs) -> None:
        super().__init__(envs)
        sensors = envs.single_observation_space
        body = gymnasium.spaces.Box(0, int(max(Cell)), sensors.shape, np.int8)
        spaces: dict[str, gymnasium.Space[Any]] = {"sensors": sensors, "body": body}
        self._set_observation(gymnasium.spaces.Dict(spaces))

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Start episodes; options as in the environments."""
        grids, infos = super().reset(seed=seed, options=options)
        return {"sensors": grids, "body": bodies_of(self.env)}, infos

    def step(self, actions: Values) -> Step:
        """Advance one control step with gas per cell, shape ``(N, n, n)``."""
        grids, rewards, terminated, truncated, infos = self.env.step(actions)
        _of_final(infos, lambda env, grid: {"sensors": grid, "body": _final_body(infos, env)})
        seen = {"sensors": grids, "body": bodies_of(self.env)}
        return seen, rewards, terminated, truncated, infos


class SensorDifferences(_View):
    """Observations that a policy can learn from; see ``ncrs_envs.wrappers.SensorDifferences``.

    Args:
        envs: vector environments of this suite in a ``FixedBodyView``.
        contrast: factor of the differences.
        change: factor of the changes.

    Raises:
        ViewError: ``envs`` do not give one value per sensor.
    """

    def __init__(self, envs: _Envs, contrast: float = CONTRAST, change: float = CHANGE) -> None:
        super().__init__(envs)
        self._scales = contrast, change
        bodies = whole_bodies_of(envs)
        sensors = int(_counts(bodies)[0, 0])
        require_vectors(envs.single_observation_space, "SensorDifferences", sensors, "sensor")
        self._contrast = SensorContrast(bodies, *self._scales)
        self._previous = np.zeros((self.num_envs, sensors), dtype=np.float32)
        self._set_observation(
            gymnasium.spaces.Box(-np.inf, np.inf, (self._contrast.size,), np.float32)
        )

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[Values, dict[str, Any]]:
        """Start episodes; changes are 0 at first."""
        values, infos = super().reset(seed=seed, options=options)
        self._contrast = SensorContrast(whole_bodies_of(self.env), *self._scales)
        mask = _is_reset(options, self.num_envs)
        self._previous = np.where(mask[:, None], values, self._previous)
        return self._contrast(values, self._previous, bodies_of(self.env)), infos

    def step(self, actions: Any) -> Step:
        """Advance one control step."""
        values, rewards, terminated, truncated, infos = self.env.step(actions)
        before = self._previous
        bodies = bodies_of(self.env)
        self._contrast_final(infos, before, bodies)
        begun = self._begun(terminated, truncated)
        seen = self._contrast(values, np.where(begun[:, None], values, before), bodies)
        self._previous = values
        return seen, rewards, terminated, truncated, infos

    def _contrast_final(
        self, infos: dict[str, Any], before: Values, bodies: NDArray[np.int8]
    ) -> None:
        final = infos.get("final_obs")
        if final is None:
            return
        last, bodies = before.copy(), bodies.copy()
        ended = np.flatnonzero(infos["_final_obs"]).tolist()
        for env in ended:
            last[env], bodies[env] = final[env], _final_body(infos, env)
        seen = self._contrast(last, before, bodies)
        for env in ended:
            final[env] = seen[env]


class ProgressReward(_View):
    """The change of the reward in its place; see ``ncrs_envs.wrappers.ProgressReward``.

    Args:
        envs: vector environments of this suite.
        scale: factor of the change.
        success_bonus: added once, in the step in which the task is first solved.
    """

    def __init__(self, envs: _Envs, scale: float = PROGRESS, success_bonus: float = 0.0) -> None:
        super().__init__(envs)
        self._scale, self._success_bonus = scale, success_bonus
        self._previous = np.full(self.num_envs, np.nan)
        self._solved = np.zeros(self.num_envs, dtype=np.bool_)

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start episodes; the first step's progress is 0."""
        observations, infos = super().reset(seed=seed, options=options)
        mask = _is_reset(options, self.num_envs)
        self._previous[mask] = np.nan
        self._solved[mask] = infos["success"][mask]
        return observations, infos

    def step(self, actions: Any) -> Step:
        """Advance one control step."""
        observations, rewards, terminated, truncated, infos = self.env.step(actions)
        same_step = self.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
        begun = self._begun(terminated, truncated)
        success = np.array(infos["success"], dtype=np.bool_)
        if same_step and begun.any():
            # In this mode infos are of the new episodes; those of the ended ones stand apart.
            success[begun] = infos["final_info"]["success"][begun]
        before = np.where(np.isnan(self._previous), rewards, self._previous)
        progress = self._scale * (rewards - before)
        progress += self._success_bonus * (success & ~self._solved)
        if not same_step:
            progress[begun] = 0.0
        self._previous = np.where(begun, np.nan, rewards)
        self._solved = np.where(begun, infos["success"], success)
        return observations, progress, terminated, truncated, infos


class DifferentialDrive(_View):
    """Two gas values, left and right; see ``ncrs_envs.wrappers.DifferentialDrive``.

    Args:
        envs: vector environments of this suite in a ``FixedBodyView``.

    Raises:
        ViewError: ``envs`` do not take one value per wheel.
    """

    def __init__(self, envs: _Envs) -> None:
        super().__init__(envs)
        bodies = whole_bodies_of(envs)
        wheels = int(_counts(bodies)[0, 1])
        require_vectors(envs.single_action_space, "DifferentialDrive", wheels, "wheel")
        self._sides = sides(bodies)
        self._set_action(gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32))

    def reset(
        self, *, seed: Any = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start episodes; options as in the environments."""
        observations, infos = super().reset(seed=seed, options=options)
        self._sides = sides(whole_bodies_of(self.env))
        return observations, infos

    def step(self, actions: Values) -> Step:
        """Advance one control step with the gas of each side, shape ``(N, 2)``.

        Raises:
            ActionError: wrong shape, or values that are not finite.
        """
        pairs = check_action(actions, (self.num_envs, 2), "the gas of the left and right side")
        return self.env.step(np.einsum("nws,ns->nw", self._sides, pairs))
