"""Views of single environments for ordinary reinforcement-learning agents."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from ncrs_envs.body import BodyError, BodyGrid, Cell, parse_body, sensor_mask, wheel_mask
from ncrs_envs.interface import check_action, check_options
from ncrs_envs.wrappers.signals import (
    CHANGE,
    CONTRAST,
    PROGRESS,
    SensorContrast,
    require_vectors,
    sides,
)

Grid = NDArray[np.float32]
Observation = dict[str, Any]

if TYPE_CHECKING:
    _GridEnv = gymnasium.Env[Grid, Grid]
    _VectorView = gymnasium.Wrapper[Grid, Grid, Grid, Grid]
    _BodyView = gymnasium.ObservationWrapper[Observation, Grid, Grid]
    _ActionView = gymnasium.ActionWrapper[Grid, Grid, Grid]
else:
    _GridEnv, _VectorView, _BodyView, _ActionView = (
        gymnasium.Env,
        gymnasium.Wrapper,
        gymnasium.ObservationWrapper,
        gymnasium.ActionWrapper,
    )


class FixedBodyView(_VectorView, RecordConstructorArgs):
    """One body's sensors and wheels as vectors, in row order.

    Observations are ``Box(0, 1, (sensors,), float32)``, actions ``Box(-1, 1, (wheels,), float32)``.
    A reset may move the parts, but not change their numbers. Lost ones keep their places: a lost
    sensor reads 0, the gas of a lost wheel is ignored.

    Args:
        env: Environment of this suite.
    """

    def __init__(self, env: _GridEnv) -> None:
        RecordConstructorArgs.__init__(self)
        gymnasium.Wrapper.__init__(self, env)
        self._set_body(env.get_wrapper_attr("whole_body"))
        sensors, wheels = self._counts
        self.observation_space = gymnasium.spaces.Box(0.0, 1.0, (sensors,), np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (wheels,), np.float32)

    def _set_body(self, body: BodyGrid) -> None:
        self._sensors, self._wheels = sensor_mask(body), wheel_mask(body)

    @property
    def _counts(self) -> tuple[int, int]:
        return int(self._sensors.sum()), int(self._wheels.sum())

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Grid, dict[str, Any]]:
        """Start an episode; seed and options are those of the environment.

        Raises:
            BodyError: ``options["body"]`` has another number of sensors or wheels.
        """
        body = check_options(options).get("body")
        if body is not None:
            grid = parse_body(body)
            found = int(sensor_mask(grid).sum()), int(wheel_mask(grid).sum())
            if found != self._counts:
                raise BodyError(
                    f"This view is of a body with {self._counts[0]} sensors and {self._counts[1]} "
                    f"wheels, got one with {found[0]} and {found[1]}; make a new environment for "
                    "it, or use BodyConditionedView."
                )
        observation, info = self.env.reset(seed=seed, options=options)
        self._set_body(self.env.get_wrapper_attr("whole_body"))
        return observation[self._sensors], info

    def step(self, action: Grid) -> tuple[Grid, float, bool, bool, dict[str, Any]]:
        """Advance one control step with one gas value per wheel, shape ``(wheels,)``.

        Raises:
            ActionError: The action has the wrong shape, or values that are not finite.
        """
        grid = np.zeros(self._wheels.shape, dtype=np.float32)
        grid[self._wheels] = check_action(action, (self._counts[1],), "one gas value per wheel")
        observation, reward, terminated, truncated, info = self.env.step(grid)
        return observation[self._sensors], float(reward), terminated, truncated, info


class BodyConditionedView(_BodyView, RecordConstructorArgs):
    """Observations that include the body, for one agent that drives many bodies.

    Observations are a Dict of ``sensors``, the environment's own grid, and ``body``,
    ``Box(0, 4, (n, n), int8)`` of cell codes. Actions stay grids.

    Args:
        env: Environment of this suite.
    """

    def __init__(self, env: _GridEnv) -> None:
        RecordConstructorArgs.__init__(self)
        gymnasium.ObservationWrapper.__init__(self, env)
        sensors = env.observation_space
        body = gymnasium.spaces.Box(0, int(max(Cell)), sensors.shape, np.int8)
        spaces: dict[str, gymnasium.Space[Any]] = {"sensors": sensors, "body": body}
        self.observation_space = gymnasium.spaces.Dict(spaces)

    def observation(self, observation: Grid) -> Observation:
        """Add the current body to a grid of sensor values."""
        return {"sensors": observation, "body": self.env.get_wrapper_attr("body").copy()}


class SensorDifferences(_VectorView, RecordConstructorArgs):
    """Observations that a policy can learn from: differences between sensors, and their changes.

    Observations are, float32: for each sensor its difference from the mean of its kind, times
    ``contrast``; the mean of each kind; for each sensor its change over the step, times ``change``.
    Lost sensors have no part in the means; their own differences and changes are 0.

    Args:
        env: one of this suite's environments in a ``FixedBodyView``.
        contrast: factor of the differences.
        change: factor of the changes.

    Raises:
        ViewError: ``env`` does not give one value per sensor.
    """

    def __init__(self, env: _GridEnv, contrast: float = CONTRAST, change: float = CHANGE) -> None:
        RecordConstructorArgs.__init__(self, contrast=contrast, change=change)
        gymnasium.Wrapper.__init__(self, env)
        self._scales = contrast, change
        body = env.get_wrapper_attr("whole_body")
        self._set_body(body)
        sensors = int(sensor_mask(body).sum())
        require_vectors(env.observation_space, "SensorDifferences", sensors, "sensor")
        self._previous = np.zeros(sensors, dtype=np.float32)
        self.observation_space = gymnasium.spaces.Box(
            -np.inf, np.inf, (self._contrast.size,), np.float32
        )

    def _set_body(self, body: BodyGrid) -> None:
        self._contrast = SensorContrast(body, *self._scales)

    @property
    def _body(self) -> BodyGrid:
        body: BodyGrid = self.env.get_wrapper_attr("body")
        return body

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Grid, dict[str, Any]]:
        """Start an episode; changes are 0 at first."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._set_body(self.env.get_wrapper_attr("whole_body"))
        self._previous = observation
        return self._contrast(observation, observation, self._body), info

    def step(self, action: Grid) -> tuple[Grid, float, bool, bool, dict[str, Any]]:
        """Advance one control step."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        seen = self._contrast(observation, self._previous, self._body)
        self._previous = observation
        return seen, float(reward), terminated, truncated, info


class ProgressReward(_VectorView, RecordConstructorArgs):
    """The change of the reward over a step in place of the reward, which hides it in a constant.

    Args:
        env: one of this suite's environments.
        scale: factor of the change.
        success_bonus: added once, in the step in which the task is first solved.
    """

    def __init__(self, env: _GridEnv, scale: float = PROGRESS, success_bonus: float = 0.0) -> None:
        RecordConstructorArgs.__init__(self, scale=scale, success_bonus=success_bonus)
        gymnasium.Wrapper.__init__(self, env)
        self._scale, self._success_bonus = scale, success_bonus
        self._previous: float | None = None
        self._solved = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Grid, dict[str, Any]]:
        """Start an episode; the first step's progress is 0."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._previous, self._solved = None, bool(info["success"])
        return observation, info

    def step(self, action: Grid) -> tuple[Grid, float, bool, bool, dict[str, Any]]:
        """Advance one control step."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        before = float(reward) if self._previous is None else self._previous
        progress = self._scale * (float(reward) - before)
        if info["success"] and not self._solved:
            progress += self._success_bonus
        self._previous, self._solved = float(reward), bool(info["success"])
        return observation, progress, terminated, truncated, info


class DifferentialDrive(_ActionView, RecordConstructorArgs):
    """Two gas values, left and right, for any number of wheels; the middle column takes the mean.

    Args:
        env: one of this suite's environments in a ``FixedBodyView``.

    Raises:
        ViewError: ``env`` does not take one value per wheel.
    """

    def __init__(self, env: _GridEnv) -> None:
        RecordConstructorArgs.__init__(self)
        gymnasium.ActionWrapper.__init__(self, env)
        wheels = int(wheel_mask(env.get_wrapper_attr("whole_body")).sum())
        require_vectors(env.action_space, "DifferentialDrive", wheels, "wheel")
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)

    def action(self, action: Grid) -> Grid:
        """Gas of each wheel, ``(wheels,)``, from left and right, ``(2,)``.

        Raises:
            ActionError: wrong shape, or values that are not finite.
        """
        pair = check_action(action, (2,), "the gas of the left and of the right side")
        gas: Grid = sides(self.env.get_wrapper_attr("whole_body")) @ pair
        return gas
