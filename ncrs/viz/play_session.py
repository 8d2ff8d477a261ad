"""The game without its window: your robot, an evolved one beside it, one scenario."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.control import Controller
from ncrs.runs.robot import EvolvedRobot
from ncrs_envs.body import BodyError, BodyGrid, Cell, cell_centers, mass_properties, parse_body
from ncrs_envs.rendering import Scene
from ncrs_envs.scenario import Scenario, sample_scenarios
from ncrs_envs.tasks import MAX_EPISODE_STEPS, TaskSettings


def steering(body: BodyGrid, throttle: float, turn: float) -> NDArray[np.float32]:
    """Steer any body like a tank.

    Args:
        body: Cell codes, ``(n, n)``, at least one cell.
        throttle: Common gas, from -1 (backward) to 1 (forward).
        turn: Difference in gas, from -1 (clockwise) to 1 (counter-clockwise): more for wheels to
            the right of the centre of mass, less for those to its left.

    Returns:
        Gas in [-1, 1], float32 ``(n, n)``, 0 in all but wheels.
    """
    x, _ = mass_properties(body).center
    side = np.sign(cell_centers(body.shape[0])[..., 0] - x)
    gas = np.clip(throttle + turn * side, -1.0, 1.0)
    return np.where(body == Cell.WHEEL, gas, 0.0).astype(np.float32)


def _make_env(settings: TaskSettings, body: BodyGrid) -> Any:
    """Make the Box2D environment without Gymnasium's time limit, so that driving may continue."""
    return gymnasium.make(
        f"ncrs_envs:{settings.task.env_id}",
        body=body.tolist(),
        grid_size=settings.grid_size,
        distance_score=settings.distance_score,
        success_radius=settings.radius,
        construction=settings.construction,
        hull_density=settings.hull_density,
    ).unwrapped


class Lane:
    """One robot's own copy of the world, on Box2D.

    Args:
        task: Task and settings.
        body: Body that the task can use.
        controller: Controller that drives the robot; None if you do.
    """

    def __init__(self, task: TaskSettings, body: BodyGrid, controller: Controller | None) -> None:
        self._env = _make_env(task, body)
        self._controller = controller
        self._total = 0.0
        self.steps = 0

    def reset(self, scenario: Scenario, body: BodyGrid | None = None) -> None:
        """Start again, with another body if one is given."""
        self._observation, _ = self._env.reset(options={"scenario": scenario, "body": body})
        if self._controller is not None:
            self._controller.reset()
        self._total, self.steps = 0.0, 0

    def step(self, action: NDArray[np.float32] | None = None) -> None:
        """Advance one step; without an action the controller acts."""
        if action is None:
            assert self._controller is not None
            action = self._controller.act(self._observation)
        self._observation, reward, *_ = self._env.step(action)
        if self.steps < MAX_EPISODE_STEPS:
            self._total += float(reward)
        self.steps += 1

    @property
    def scene(self) -> Scene:
        """The current scene."""
        scene: Scene = self._env.scene
        return scene

    @property
    def fitness(self) -> float:
        """Mean reward so far, over the task's 100 steps at most."""
        return self._total / max(1, min(self.steps, MAX_EPISODE_STEPS))

    def close(self) -> None:
        """Free the environment."""
        self._env.close()


class PlaySession:
    """Session of you against the clock, or against an evolved robot in the same scenario.

    Time stands still until you drive; editing your body starts the episode again.

    Args:
        task: Task and settings.
        body: Your body to begin with.
        rival: Evolved robot for the same task, or None.
        seed: Seed for sampling the scenarios.
        endless: Let the episode continue after the task's 100 steps.

    Raises:
        BodyError: If the task cannot use the body.
    """

    def __init__(
        self,
        task: TaskSettings,
        body: BodyGrid,
        rival: EvolvedRobot | None = None,
        *,
        seed: int = 0,
        endless: bool = False,
    ) -> None:
        self._settings = task
        self.task = self._settings.task
        self.body = parse_body(body, self._settings.grid_size)
        self.rival_body = None if rival is None else rival.body
        self.problem: str | None = None
        """Reason why your body cannot drive; None if it can."""
        self.yours = Lane(task, self.body, None)
        self.rivals: Lane | None = None
        if rival is not None:
            self.rivals = Lane(task, rival.body, Controller(rival.nca, rival.body))
        self._endless = endless
        self._seed, self._number = seed, 0
        self.restart()

    @property
    def cells(self) -> tuple[Cell, ...]:
        """Cell types that you may use."""
        return (Cell.EMPTY, *self.task.part_cells)

    @property
    def scenario(self) -> Scenario:
        """The current placements."""
        drawn = sample_scenarios(self.task, self._seed, self._number + 1, self._settings.grid_size)
        return drawn[-1]

    @property
    def finished(self) -> bool:
        """True if the episode is over for you."""
        return not self._endless and self.yours.steps >= MAX_EPISODE_STEPS

    def restart(self) -> None:
        """Put both robots back to the start of the same scenario."""
        scenario = self.scenario
        self.yours.reset(scenario, self.body if self.problem is None else None)
        if self.rivals is not None:
            self.rivals.reset(scenario)
        self.started = False

    def next_scenario(self) -> None:
        """Take another scenario; the regions take turns."""
        self._number += 1
        self.restart()

    def paint(self, row: int, column: int, cell: Cell) -> None:
        """Change one cell of your body and start again; ``problem`` says if it cannot drive.

        Raises:
            BodyError: If the task does not have that cell type.
        """
        if cell not in self.cells:
            raise BodyError(f"{self.task.name} has no {self.task.cell_label(cell)}.")
        body = self.body.copy()
        body[row, column] = int(cell)
        self.wear(body)

    def wear(self, body: BodyGrid) -> None:
        """Replace the whole body and start again; ``problem`` says if it cannot drive."""
        self.body = parse_body(body, self._settings.grid_size)
        try:
            self.task.check_body(self.body)
        except BodyError as error:
            self.problem = str(error)
            return
        self.problem = None
        self.restart()

    def step(self, throttle: float, turn: float) -> None:
        """Advance one step, unless you have not started, are done, or cannot drive."""
        self.started = self.started or throttle != 0.0 or turn != 0.0
        if not self.started or self.finished or self.problem is not None:
            return
        self.yours.step(steering(self.body, throttle, turn))
        if self.rivals is not None and self.rivals.steps < MAX_EPISODE_STEPS:
            self.rivals.step()

    def close(self) -> None:
        """Free the environments."""
        self.yours.close()
        if self.rivals is not None:
            self.rivals.close()
