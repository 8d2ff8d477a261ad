"""Views of the environments for ordinary reinforcement-learning agents."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from ncrs_envs.body import BodyError, BodyGrid, Cell, parse_body, sensor_mask, wheel_mask
from ncrs_envs.interface import check_action, check_options

Grid = NDArray[np.float32]
Observation = dict[str, Any]

if TYPE_CHECKING:
    _GridEnv = gymnasium.Env[Grid, Grid]
    _VectorView = gymnasium.Wrapper[Grid, Grid, Grid, Grid]
    _BodyView = gymnasium.ObservationWrapper[Observation, Grid, Grid]
else:
    _GridEnv, _VectorView, _BodyView = (
        gymnasium.Env,
        gymnasium.Wrapper,
        gymnasium.ObservationWrapper,
    )


class FixedBodyView(_VectorView, RecordConstructorArgs):
    """One body's sensors and wheels as vectors, in row order.

    Observations are ``Box(0, 1, (sensors,), float32)``, actions ``Box(-1, 1, (wheels,), float32)``.
    A reset may move the parts, but not change their numbers.

    Args:
        env: Environment of this suite.
    """

    def __init__(self, env: _GridEnv) -> None:
        RecordConstructorArgs.__init__(self)
        gymnasium.Wrapper.__init__(self, env)
        self._set_body(env.get_wrapper_attr("body"))
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
        self._set_body(info["body"])
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
