"""The Gymnasium environments: spaces, options, sticky bodies, info and rendering over an Episode."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from ncrs_envs.body import (
    DEFAULT_GRID_SIZE,
    BodyGrid,
    parse_body,
    sensor_mask,
    wheel_mask,
)
from ncrs_envs.episode import Episode, Robot
from ncrs_envs.physics import DT
from ncrs_envs.rendering import DEFAULT_RENDER_SIZE, Scene, Window, check_render_size, draw_scene
from ncrs_envs.scenario import (
    Scenario,
    ScenarioError,
    check_region,
    sample_scenario,
    wall_quads,
)
from ncrs_envs.tasks import (
    CARRY_BALL,
    LIGHT_CHASE,
    OBSTACLE,
    Task,
    default_body,
    playfield,
    task_settings,
)

if TYPE_CHECKING:
    _BaseEnv = gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]
else:
    _BaseEnv = gymnasium.Env

RESET_OPTIONS = ("body", "region", "scenario")
RENDER_MODES = ("human", "rgb_array")


class OptionError(ValueError):
    """An unknown option of ``reset``, or options that exclude each other."""


class ActionError(ValueError):
    """An action of the wrong shape, or with values that are not finite numbers."""


def check_options(options: dict[str, Any] | None) -> dict[str, Any]:
    """Return the reset options as a dict; ``OptionError`` names what is unknown or contradictory."""
    options = options or {}
    unknown = sorted(set(options) - set(RESET_OPTIONS))
    if unknown:
        raise OptionError(f"Unknown reset options {unknown}; known are {list(RESET_OPTIONS)}.")
    if options.get("region") is not None and options.get("scenario") is not None:
        raise OptionError("Give either region or scenario: a scenario already says where all is.")
    return options


class RobotEnv(_BaseEnv):
    """A modular robot on Box2D; the task's subclass says what it is rewarded for."""

    metadata: dict[str, Any] = {  # noqa: RUF012 - Gymnasium's own declaration
        "render_modes": list(RENDER_MODES),
        "render_fps": round(1.0 / DT),
    }
    task: ClassVar[Task]

    def __init__(
        self,
        body: Any = None,
        grid_size: int | None = None,
        render_mode: str | None = None,
        distance_score: str = "exponential",
        success_radius: float | None = None,
        terminate_on_success: bool = False,
        render_size: int = DEFAULT_RENDER_SIZE,
    ) -> None:
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise OptionError(
                f"render_mode must be None or one of {list(RENDER_MODES)}, got {render_mode!r}."
            )
        if grid_size is None:
            grid_size = DEFAULT_GRID_SIZE if body is None else parse_body(body).shape[0]
        self.settings = task_settings(self.task, grid_size, distance_score, success_radius)
        n = self.settings.grid_size
        self.render_mode = render_mode
        self.render_size = check_render_size(render_size)
        self.terminate_on_success = bool(terminate_on_success)
        self.observation_space = gymnasium.spaces.Box(0.0, 1.0, (n, n), np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (n, n), np.float32)
        self._robot = self._make_robot(default_body(self.task, n) if body is None else body)
        self._episode: Episode | None = None
        self._action = np.zeros((n, n), dtype=np.float32)
        self._path: list[tuple[float, float]] = []
        self._window: Window | None = None

    @property
    def spec(self) -> EnvSpec | None:  # type: ignore[override]
        """The spec this was made from. Its body is kept as nested lists, so that JSON can hold it."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        if spec is not None and spec.kwargs.get("body") is not None:
            spec = copy.copy(spec)
            spec.kwargs = {**spec.kwargs, "body": parse_body(spec.kwargs["body"]).tolist()}
        self._spec = spec

    _spec: EnvSpec | None = None

    @property
    def body(self) -> BodyGrid:
        """The current body, int8 ``(n, n)``, read-only."""
        return self._robot.body

    @property
    def scenario(self) -> Scenario | None:
        """Placements of the current episode; None before the first reset."""
        return None if self._episode is None else self._episode.scenario

    def _make_robot(self, body: Any) -> Robot:
        grid = parse_body(body, self.settings.grid_size)
        self.task.check_body(grid)
        return Robot(grid)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode.

        Args:
            seed: seeds ``np_random``, the only source of randomness.
            options: ``body`` (kept for later episodes too), and ``region`` (0 to 3) or
                ``scenario`` (a ``Scenario``) for this episode alone.

        Raises:
            OptionError: unknown or contradictory options.
            BodyError: a malformed body, or one that the task cannot use.
            ScenarioError: an unknown region, or a scenario that does not fit.
        """
        options = check_options(options)
        n = self.settings.grid_size
        body, scenario, region = (options.get(name) for name in ("body", "scenario", "region"))
        robot = self._robot if body is None else self._make_robot(body)
        if region is not None:
            check_region(region)
        if scenario is not None:
            if not isinstance(scenario, Scenario):
                raise ScenarioError(
                    f"scenario must be an ncrs_envs.Scenario, got {type(scenario).__name__}."
                )
            scenario.check(self.task, n)
        super().reset(seed=seed)
        if scenario is None:
            scenario = sample_scenario(self.task, self.np_random, region, n)
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
            action: gas per cell, shape ``(n, n)``; read in wheel cells, clipped to [-1, 1].

        Raises:
            ResetNeeded: no episode has been started.
            ActionError: wrong shape, or values that are not finite.
        """
        if self._episode is None:
            raise ResetNeeded("Call reset() before step(): no episode has been started.")
        self._action = self._check_action(action)
        reward = self._episode.step(self._action)
        self._path.append(self._episode.pose[:2])
        if self.render_mode == "human":
            self.render()
        terminated = self.terminate_on_success and self._episode.success
        return self._episode.observation, reward, terminated, False, self._info(self._episode)

    def _check_action(self, action: Any) -> NDArray[np.float32]:
        n = self.settings.grid_size
        try:
            grid = np.asarray(action, dtype=np.float32)
        except (TypeError, ValueError) as error:
            raise ActionError(f"action must be a {n} x {n} grid of numbers, got {action!r}.") from error
        if grid.shape != (n, n):
            raise ActionError(
                f"action must have shape ({n}, {n}), one gas value per cell, got {grid.shape}."
            )
        if not np.isfinite(grid).all():
            row, column = np.argwhere(~np.isfinite(grid))[0]
            raise ActionError(
                f"action must be finite, got {grid[row, column]} in row {row}, column {column}."
            )
        return grid

    def _info(self, episode: Episode) -> dict[str, Any]:
        body = episode.robot.body
        info: dict[str, Any] = {
            "body": body.copy(),
            "sensor_mask": sensor_mask(body),
            "wheel_mask": wheel_mask(body),
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
        """What there is to draw now. Raises ``ResetNeeded`` before the first reset."""
        if self._episode is None:
            raise ResetNeeded("Call reset() before render(): there is nothing to show yet.")
        episode = self._episode
        return Scene(
            extent=playfield(self.settings.grid_size),
            body=episode.robot.body,
            pose=episode.pose,
            sensor_values=episode.observation,
            action=self._action,
            light=episode.scenario.light,
            ball=episode.ball,
            target=episode.scenario.target,
            wall_quads=wall_quads(episode.scenario, self.settings.grid_size),
            path=np.array(self._path),
            success=episode.success,
            success_radius=self.settings.success_radius,
        )

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        """An RGB frame ``(render_size, render_size, 3)``, or None after showing it in a window."""
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

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None


_DOC = """{summary}

    ## Description
    {description}

    The robot is a grid of square cells, each of side 2 units: tissue, sensors and wheels, all one
    rigid body. By default the grid is 5 x 5 and the body a small four-wheeled one; pass your own
    with `body`. The playfield runs from -P to P on both axes, with P = max(50, 5 n + 35) for an
    n x n grid: 60 units for 5 x 5. One step is 1/50 s.

    ## Action Space
    `Box(-1, 1, (n, n), float32)`: the gas of each cell, read in wheel cells and ignored elsewhere.
    A wheel at gas 1 pushes forward (the body's +y) with a force of 1000 and brakes with 20 per unit
    of speed forward, 100 per unit sideways. Values beyond [-1, 1] are clipped; NaN and infinite
    ones are refused.

    ## Observation Space
    `Box(0, 1, (n, n), float32)`: in sensor cells `exp(-d / P)`, with d the distance from the cell's
    centre to {sensed}; 0 elsewhere. `info` holds `body`, `sensor_mask`, `wheel_mask`, `pose`
    (x, y, heading in radians), {distances} and `success` (so far in this episode){crossed}.

    ## Rewards
    {rewards}
    With `distance_score="inverse_square"` the score of a distance d is `(d / P + 1)^-2` instead of
    `exp(-d / P)`, in rewards and sensors alike.

    ## Starting State
    {start}
    `reset(options={{"region": k}})` pins the region, `reset(options={{"scenario": scenario}})`
    all placements, and `reset(options={{"body": grid}})` sets the body for this and later episodes.

    ## Episode End
    Termination: never, unless `terminate_on_success` is set; then as soon as {success}.
    Truncation: after 100 steps (2 s).

    ## Arguments
    `gymnasium.make("{env_id}", body=None, grid_size=None, render_mode=None,
    distance_score="exponential", success_radius=None, terminate_on_success=False,
    render_size=512)`
    - `body`: cell codes (0 empty, 1 tissue, 2 {sensor_2}, {code_3}4 wheel), as an array, nested
      lists or rows of characters. It stays until `reset` replaces it.
    - `grid_size`: n, at least 3; that of `body` by default, or 5.
    - `render_mode`: None, "rgb_array" or "human".
    - `distance_score`: "exponential" or "inverse_square".
    - `success_radius`: units, {radius:g} by default.
    - `terminate_on_success`: end the episode when it succeeds.
    - `render_size`: side of a frame in pixels.

    ## Version History
    - v0: first version.
    """


class LightChaseEnv(RobotEnv):
    __doc__ = _DOC.format(
        summary="Drive to a light in the open.",
        description="A light shines in one of four corners; the robot starts in the middle.",
        sensed="the light's centre",
        distances="`distance` (robot to light)",
        crossed="",
        rewards="`exp(-d / P)` each step, with d the distance from the robot's centre to the light.",
        start=(
            "The robot stands at (0, 0), heading +y. The light, a solid disc of radius 1, stands at\n"
            "    (-+0.6 P, -+0.6 P) plus uniform noise of +-0.05 P on each axis."
        ),
        success="the robot's centre has come within 20 units of the light",
        env_id=LIGHT_CHASE.env_id,
        sensor_2="light sensor",
        code_3="",
        radius=LIGHT_CHASE.success_radius,
    )
    task = LIGHT_CHASE


class ObstacleEnv(RobotEnv):
    __doc__ = _DOC.format(
        summary="Drive to a light through a passage between two ragged walls.",
        description=(
            "Two walls narrow to a passage 1.4 n units wide, which a full-width robot cannot pass;\n"
            "    the light shines behind it."
        ),
        sensed="the light's centre (walls do not hide it)",
        distances="`distance` (robot to light)",
        crossed=", and `crossed` (the centre has been above y = 0)",
        rewards="`exp(-d / P)` each step, with d the distance from the robot's centre to the light.",
        start=(
            "The robot stands at y = -0.85 P with x uniform in +-0.6 P, heading +y, clear of the\n"
            "    walls. The light stands at x in (-0.6 P, -0.3 P, 0.3 P, 0.6 P) and y = 0.6 P, plus\n"
            "    uniform noise of +-0.05 P on each axis. The passage's centre is uniform in +-0.8 P."
        ),
        success="the robot's centre has come within 20 units of the light",
        env_id=OBSTACLE.env_id,
        sensor_2="light sensor",
        code_3="",
        radius=OBSTACLE.success_radius,
    )
    task = OBSTACLE


class CarryBallEnv(RobotEnv):
    __doc__ = _DOC.format(
        summary="Push a ball to a target area.",
        description="A light ball lies ahead of the robot, and a square target area beyond it.",
        sensed="the ball (code 2) or the target (code 3)",
        distances="`distance_to_ball`, `ball_to_target`",
        crossed="",
        rewards=(
            "`0.5 exp(-a / P) + 0.5 exp(-b / P)` each step, with a the distance from the robot's\n"
            "    centre to the ball and b from the ball to the target."
        ),
        start=(
            "The robot stands at y = -0.85 P with x uniform in +-0.6 P, heading +y. The ball, of\n"
            "    radius 1, lies at x in (-0.6 P, -0.3 P, 0.3 P, 0.6 P) and y = 0, plus uniform noise of\n"
            "    +-0.05 P on each axis. The target is at one of the same four x at random, y = 0.6 P."
        ),
        success="the ball has come within 10 units of the target",
        env_id=CARRY_BALL.env_id,
        sensor_2="ball sensor",
        code_3="3 target sensor, ",
        radius=CARRY_BALL.success_radius,
    )
    task = CARRY_BALL
