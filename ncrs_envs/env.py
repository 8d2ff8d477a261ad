"""Gymnasium environments: spaces, options, sticky bodies, info and pictures of an ``Episode``."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from ncrs_envs.body import (
    DEFAULT_GRID_SIZE,
    HULL_DENSITY,
    BodyGrid,
    parse_body,
)
from ncrs_envs.env_docs import (
    CARRY_BALL_DOC,
    LIGHT_CHASE_DOC,
    OBSTACLE_DOC,
    OBSTACLE_TOUCH_DOC,
)
from ncrs_envs.episode import Episode, Robot
from ncrs_envs.interface import (
    OptionError,
    check_action,
    check_damage,
    check_flag,
    check_options,
)
from ncrs_envs.physics import DT
from ncrs_envs.rendering import DEFAULT_RENDER_SIZE, Scene, Window, check_render_size, draw_scene
from ncrs_envs.scenario import (
    Scenario,
    ScenarioError,
    check_region,
    sample_scenario,
)
from ncrs_envs.tasks import (
    CARRY_BALL,
    LIGHT_CHASE,
    OBSTACLE,
    OBSTACLE_TOUCH,
    RIGID,
    Task,
    TaskSettings,
    default_body,
    get_task,
)

if TYPE_CHECKING:
    _BaseEnv = gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]
else:
    _BaseEnv = gymnasium.Env

RENDER_MODES = ("human", "rgb_array")


class RobotEnv(_BaseEnv):
    """A modular robot on Box2D; each task has a subclass."""

    metadata: dict[str, Any] = {  # noqa: RUF012 - Gymnasium's own declaration
        "render_modes": list(RENDER_MODES),
        "render_fps": round(1.0 / DT),
    }
    task: ClassVar[Task]

    def __init__(  # noqa: PLR0913 - the public call
        self,
        body: Any = None,
        grid_size: int | None = None,
        render_mode: str | None = None,
        distance_score: str = "exponential",
        success_radius: float | None = None,
        terminate_on_success: bool = False,
        render_size: int = DEFAULT_RENDER_SIZE,
        construction: str = RIGID,
        hull_density: float = HULL_DENSITY,
    ) -> None:
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise OptionError(
                f"render_mode must be None or one of {list(RENDER_MODES)}, got {render_mode!r}."
            )
        if grid_size is None:
            grid_size = DEFAULT_GRID_SIZE if body is None else parse_body(body).shape[0]
        self.settings = TaskSettings(
            self.task.name, grid_size, distance_score, success_radius, construction, hull_density
        )
        n = self.settings.grid_size
        self.render_mode = render_mode
        self.render_size = check_render_size(render_size)
        self.terminate_on_success = check_flag(terminate_on_success, "terminate_on_success")
        self.observation_space = gymnasium.spaces.Box(0.0, 1.0, (n, n), np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (n, n), np.float32)
        self._robot = self._make_robot(default_body(self.task, n) if body is None else body)
        self._episode: Episode | None = None
        self._action = np.zeros((n, n), dtype=np.float32)
        self._path: list[tuple[float, float]] = []
        self._window: Window | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """Spec of this environment, with its arguments as plain values that JSON can hold."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        if spec is not None:
            spec = copy.copy(spec)
            spec.kwargs = {name: _plain(name, value) for name, value in spec.kwargs.items()}
        self._spec = spec

    _spec: EnvSpec | None = None

    @property
    def body(self) -> BodyGrid:
        """Present body, int8 ``(n, n)``, read-only: what damage has left of it."""
        return (self._robot if self._episode is None else self._episode.robot).body

    @property
    def whole_body(self) -> BodyGrid:
        """Body before any damage, int8 ``(n, n)``, read-only."""
        return self._robot.body

    @property
    def scenario(self) -> Scenario | None:
        """Placements of the current episode; None before the first reset."""
        return None if self._episode is None else self._episode.scenario

    def _make_robot(self, body: Any) -> Robot:
        grid = parse_body(body, self.settings.grid_size)
        self.task.check_body(grid)
        return Robot(grid, self.settings.hull_density)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode.

        Args:
            seed: Seed for ``np_random``, the only source of randomness; None leaves it as it is.
            options: ``body``, kept for later episodes too, and ``region``, 0 to 3, or ``scenario``,
                a ``Scenario``, and ``damage``, a ``Damage`` in place of the scenario's, for this
                episode only; None for no options.

        Raises:
            OptionError: An option is unknown, or options exclude each other.
            BodyError: The body is malformed, or the task cannot use it.
            ScenarioError: The region is unknown, or the scenario does not fit the task.
            PerturbationError: The damage is malformed, or does not fit the grid.
        """
        chosen = check_options(options)
        n = self.settings.grid_size
        body, scenario, region = (chosen.get(name) for name in ("body", "scenario", "region"))
        robot = self._robot if body is None else self._make_robot(body)
        if region is not None:
            check_region(region)
        if scenario is not None:
            if not isinstance(scenario, Scenario):
                raise ScenarioError(
                    f"scenario must be an ncrs_envs.Scenario, got {type(scenario).__name__}."
                )
            scenario.check(self.task, n)
        damage = chosen.get("damage")
        if damage is not None:
            check_damage(damage, n)
        super().reset(seed=seed)
        if scenario is None:
            scenario = sample_scenario(self.task, self.np_random, region, n)
        if damage is not None:
            scenario = replace(scenario, damage=damage)
        self._robot = robot
        self._episode = Episode(self.settings, robot, scenario)
        self._action = np.zeros((n, n), dtype=np.float32)
        self._path = [self._episode.pose[:2]]
        if self.render_mode == "human":
            self.render()
        return self._episode.observation, self._info(self._episode)

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Advance one control step of 1/50 s.

        Args:
            action: Gas per cell, shape ``(n, n)``; read in wheel cells, clipped to [-1, 1].

        Raises:
            ResetNeeded: No episode has been started.
            ActionError: The action has the wrong shape, or values that are not finite.
        """
        if self._episode is None:
            raise ResetNeeded("Call reset() before step(): no episode has been started.")
        n = self.settings.grid_size
        self._action = check_action(action, (n, n), "one gas value per cell")
        reward = self._episode.step(self._action)
        self._path.append(self._episode.pose[:2])
        if self.render_mode == "human":
            self.render()
        terminated = self.terminate_on_success and self._episode.success
        return self._episode.observation, reward, terminated, False, self._info(self._episode)

    def _info(self, episode: Episode) -> dict[str, Any]:
        robot = episode.robot
        info: dict[str, Any] = {
            "body": robot.body.copy(),
            "sensor_mask": robot.sensor_mask.copy(),
            "wheel_mask": robot.wheel_mask.copy(),
            "pose": np.array(episode.pose),
            "success": episode.success,
        }
        if self.task.has_ball:
            to_ball, to_target = episode.distances
            info["distance_to_ball"] = to_ball
            info["ball_to_target"] = to_target
        else:
            info["distance"] = episode.distances[0]
        if self.task.has_walls:
            info["crossed"] = episode.crossed
        return info

    @property
    def scene(self) -> Scene:
        """Current scene, for drawing. Raises ``ResetNeeded`` before the first reset."""
        if self._episode is None:
            raise ResetNeeded("Call reset() before render(): there is nothing to show yet.")
        return self._episode.scene(self._action, self._path)

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the current scene.

        Returns:
            RGB, uint8 ``(render_size, render_size, 3)``, if ``render_mode`` is "rgb_array"; None if
            it is "human", which shows the picture in a window, or None, which gives a warning.

        Raises:
            ResetNeeded: No episode has been started.
        """
        if self.render_mode is None:
            gymnasium.logger.warn(
                "render() was called without a render_mode; make the environment with "
                "render_mode='rgb_array' or 'human'."
            )
            return None
        frame = draw_scene(self.scene, self.render_size)
        if self.render_mode == "rgb_array":
            return frame
        if self._window is None:
            self._window = Window(f"NCRS {self.task.name}", self.metadata["render_fps"])
        self._window.show(frame)
        return None

    def __getstate__(self) -> dict[str, Any]:
        """Return what a pickle or a copy holds: all but the window."""
        return {**self.__dict__, "_window": None}

    def close(self) -> None:
        """Close the window if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None


def _plain(name: str, value: Any) -> Any:
    """Convert an argument to plain Python types; a body becomes nested lists of cell codes."""
    if name == "body" and value is not None:
        return parse_body(value).tolist()
    return value.item() if isinstance(value, np.generic) else value


class LightChaseEnv(RobotEnv):  # noqa: D101 - from env_docs
    __doc__ = LIGHT_CHASE_DOC
    task = LIGHT_CHASE


class ObstacleEnv(RobotEnv):  # noqa: D101 - from env_docs
    __doc__ = OBSTACLE_DOC
    task = OBSTACLE


class CarryBallEnv(RobotEnv):  # noqa: D101 - from env_docs
    __doc__ = CARRY_BALL_DOC
    task = CARRY_BALL


class ObstacleTouchEnv(RobotEnv):  # noqa: D101 - from env_docs
    __doc__ = OBSTACLE_TOUCH_DOC
    task = OBSTACLE_TOUCH


def make_task_env(task: str, **arguments: Any) -> RobotEnv:
    """Make the environment of a registered task, with the arguments of ``RobotEnv``.

    Raises:
        TaskError: If the task is unknown.
    """
    found = get_task(task)
    made: type[RobotEnv] = type(f"{found.title}Env", (RobotEnv,), {"task": found})
    return made(**arguments)
