"""One episode on Box2D: a body in a scenario, with the task's sensing, reward and success.

Both the Gymnasium environments and the ``box2d`` engine step this class.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.body import (
    HULL_DENSITY,
    BodyGrid,
    Cell,
    cell_centers,
    sensor_mask,
    wheel_mask,
)
from ncrs_envs.box2d_jointed import JointedWorld
from ncrs_envs.box2d_world import Pose, RobotWorld
from ncrs_envs.noise import SENSOR_NOISE, normal_noise
from ncrs_envs.perturbing import check_can_change
from ncrs_envs.physics import TOUCH_DECAY, WheelModel, wheel_model
from ncrs_envs.rendering import Scene
from ncrs_envs.scenario import Point, Scenario, wall_quads
from ncrs_envs.tasks import JOINTED, TaskError, TaskSettings, distance_score, playfield

_LOWEST, _HIGHEST = np.array(-1.0), np.array(1.0)
"""Range of the gas, as arrays, which numpy compares with sooner than with numbers."""


class Robot:
    """A body that is not empty, with its wheel model and sensors computed once for all episodes."""

    def __init__(self, body: BodyGrid, hull_density: float = HULL_DENSITY) -> None:
        self.body = body
        self.wheels: WheelModel = wheel_model(body, hull_density)
        self.sensor_mask = sensor_mask(body)
        self.wheel_mask = wheel_mask(body)
        self.sensor_cells = np.flatnonzero(self.sensor_mask)
        codes = body.reshape(-1)[self.sensor_cells]
        points = cell_centers(body.shape[0]).reshape(-1, 2)[self.sensor_cells].tolist()
        senses_target = (codes == Cell.TARGET_SENSOR).tolist()
        self.sensors = [(x, y, far) for (x, y), far in zip(points, senses_target, strict=True)]
        """Place of each sensor in the body's frame, and whether it senses the target, instead of
        the light or the ball."""
        self.touch_sensors = np.flatnonzero(codes == Cell.TOUCH_SENSOR)
        """Indices of the touch sensors among the sensors."""


class Episode:
    """A running episode.

    Args:
        settings: Task and its settings.
        robot: Robot with a body that is valid for the task, and with the settings' hull density.
        scenario: Placements that fit the task.
    """

    def __init__(self, settings: TaskSettings, robot: Robot, scenario: Scenario) -> None:
        check_can_change(scenario, settings)
        self.settings = settings
        self.robot = robot
        self.scenario = scenario
        self.steps = 0
        """Number of steps done."""
        self.hit = self.damaged = robot.body
        """Body that the damage struck, and what it left; the whole one before it."""
        world = JointedWorld if settings.construction == JOINTED else RobotWorld
        self.world = world(robot.body, robot.wheels, scenario)
        failure = scenario.failure
        self._failed = None if failure is None else failure.failed(robot.body).reshape(-1)
        self.success = False
        self.crossed = False
        self._task = settings.task
        self._extent = playfield(settings.grid_size)
        self._radius = settings.radius
        self._touch = np.zeros(len(robot.touch_sensors), dtype=np.float32)
        self._read_poses()
        self.closest: tuple[float, ...] = (math.inf,) * len(self.distances)
        """Minima of the ``distances`` over the steps so far, in units; infinite at the start."""
        self._lose_cells_if_due()

    def _lose_cells_if_due(self) -> None:
        damage = self.scenario.damage
        if damage is not None and damage.step == self.steps:
            self.hit = self.robot.body
            self.damaged = damage.left(self.hit)
            self.exchange(self.damaged)

    def exchange(self, body: BodyGrid) -> None:
        """Continue with another body on the same grid, which keeps its place and its motion."""
        if not np.array_equal(body, self.robot.body):
            touch = np.zeros(body.size, dtype=np.float32)
            touch[self.robot.sensor_cells[self.robot.touch_sensors]] = self._touch
            self.robot = Robot(body, self.robot.wheels.hull_density)
            self._touch = touch[self.robot.sensor_cells[self.robot.touch_sensors]]
            self.world.exchange(body, self.robot.wheels)
            self._read_poses()

    def _read_poses(self) -> None:
        """Read the positions of robot and ball, once per step."""
        self.pose: Pose = self.world.pose
        self.ball: Point | None = self.world.ball
        self.distances: tuple[float, ...] = self._distances()
        """Distances in units: robot to light; in CarryBall robot to ball, and ball to target."""

    def step(self, action: NDArray[np.floating]) -> float:
        """Advance one control step and return the reward.

        Args:
            action: Finite gas per cell, shape ``(n, n)``; read in wheel cells, clipped to [-1, 1].
        """
        cells = self.robot.wheels.wheel_cells
        gas = action.take(cells).astype(np.float64)
        failure = self.scenario.failure
        if failure is not None and self._failed is not None and self.steps >= failure.step:
            gas[self._failed[cells]] = 0.0
        self.world.step(np.minimum(np.maximum(gas, _LOWEST), _HIGHEST))
        self._read_poses()
        self._feel()
        distances = self.distances
        self.closest = tuple(map(min, self.closest, distances))
        self.success = self.success or self._succeeds()
        self.crossed = self.crossed or self.pose[1] > 0.0
        reward = self._reward(distances)
        self.steps += 1
        self._lose_cells_if_due()
        return reward

    def _feel(self) -> None:
        """Update the touch sensors."""
        sensors = self.robot.touch_sensors
        if len(sensors):
            touching = self.world.cells_at_walls
            touched = [place in touching for place in self.robot.sensor_cells[sensors].tolist()]
            faded = (TOUCH_DECAY * self._touch.astype(np.float64)).astype(np.float32)
            self._touch = np.where(touched, np.float32(1.0), faded)

    def _succeeds(self) -> bool:
        succeeds = self._task.succeeds
        if succeeds is not None:
            return bool(succeeds(self))
        return self.closest[-1] <= self._radius

    def _reward(self, distances: Sequence[float]) -> float:
        task = self._task
        if task.reward is None:
            kind = self.settings.distance_score
            return sum([distance_score(d, self._extent, kind) for d in distances]) / len(distances)
        reward = float(task.reward(self))
        if not math.isfinite(reward):
            raise TaskError(f"The reward of {task.name} must be finite, got {reward}.")
        return reward

    def scene(self, action: NDArray[np.float32], path: Sequence[Point]) -> Scene:
        """Describe the current scene, for drawing.

        Args:
            action: Gas per cell in the last step, shape ``(n, n)``; zeros at the start.
            path: Robot centres so far, oldest first.
        """
        return Scene(
            extent=self._extent,
            body=self.robot.body,
            pose=self.pose,
            sensor_values=self.observation,
            action=action,
            light=self.scenario.light,
            ball=self.ball,
            target=self.scenario.target,
            wall_quads=wall_quads(self.scenario, self.settings.grid_size),
            path=np.array(path),
            success=self.success,
            success_radius=self.settings.radius,
        )

    def _distances(self) -> tuple[float, ...]:
        x, y, _ = self.pose
        if self.ball is not None and self.scenario.target is not None:
            return (math.dist((x, y), self.ball), math.dist(self.ball, self.scenario.target))
        assert self.scenario.light is not None
        return (math.dist((x, y), self.scenario.light),)

    @property
    def observation(self) -> NDArray[np.float32]:
        """Sensor values in sensor cells, 0 elsewhere; float32, shape ``(n, n)``."""
        n = self.settings.grid_size
        observation = np.zeros(n * n, dtype=np.float32)
        observation[self.robot.sensor_cells] = self.sensor_values
        return observation.reshape(n, n)

    @property
    def sensor_values(self) -> NDArray[np.float64]:
        """Values of the sensors in row order, in [0, 1], shape ``(sensors,)``."""
        values = self._noisy(np.array(self._scores()))
        if len(self._touch):
            values[self.robot.touch_sensors] = self._touch
        return values

    def _scores(self) -> list[float]:
        """Scores of the sensors' distances from what light and target sensors see."""
        seen = self.ball if self.ball is not None else self.scenario.light
        assert seen is not None
        x, y, angle = self.pose
        cos, sin = math.cos(angle), math.sin(angle)
        to_seen = (x - seen[0], y - seen[1])
        target = self.scenario.target
        to_target = to_seen if target is None else (x - target[0], y - target[1])
        extent, kind = self._extent, self.settings.distance_score
        scores = []
        for right, ahead, senses_target in self.robot.sensors:
            d_x, d_y = to_target if senses_target else to_seen
            d_x += right * cos - ahead * sin
            d_y += right * sin + ahead * cos
            scores.append(distance_score(math.sqrt(d_x * d_x + d_y * d_y), extent, kind))
        return scores

    def _noisy(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        noise = self.scenario.noise
        if noise is None or not noise.sensor:
            return values
        counters = self.steps * self.robot.body.size + self.robot.sensor_cells
        drawn = normal_noise(noise.seed, SENSOR_NOISE, counters)
        return np.clip(values + noise.sensor * drawn, 0.0, 1.0)
