"""The Gymnasium vector environments over the batched simulator.

``gymnasium.make_vec(id, num_envs)`` makes them. Their spaces, rewards, options and infos are those
of the single environments; ``vectorization_mode="sync"`` gives the same on Box2D.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from ncrs_envs.batched.env_robots import EnvRobots
from ncrs_envs.batched.env_streams import EnvStreams
from ncrs_envs.batched.episode_batch import EpisodeBatch
from ncrs_envs.batched.pictures import Pictures, check_render_envs, frame_size
from ncrs_envs.batched.scenario_table import Indices
from ncrs_envs.batched.vector_base import EpisodeRules, VectorBase
from ncrs_envs.batched.vector_options import (
    batch_info,
    check_count,
    check_mask,
    check_seeds,
)
from ncrs_envs.bodies import grid_side
from ncrs_envs.body import HULL_DENSITY
from ncrs_envs.interface import OptionError, check_action
from ncrs_envs.rendering import Scene
from ncrs_envs.scenario import Scenario
from ncrs_envs.tasks import (
    CARRY_BALL,
    LIGHT_CHASE,
    MAX_EPISODE_STEPS,
    OBSTACLE,
    OBSTACLE_TOUCH,
    RIGID,
    TaskSettings,
)


class RobotVectorEnv(VectorBase):
    """Modular robots, one in each environment; each task has a subclass.

    Args:
        num_envs: Number of environments.
        max_episode_steps: Steps after which episodes are truncated; -1 for never.
        body: One body for all, or one for each, shape ``(num_envs, n, n)``.
        grid_size: Side of the body grid; by default that of ``body``, or 5.
        render_mode: Render mode, None or "rgb_array".
        distance_score: Kind of distance score, "exponential" or "inverse_square".
        success_radius: Success radius in units; by default the task's own.
        terminate_on_success: True to end an episode when it succeeds.
        render_size: Side of a frame in pixels. A frame takes ``3 * render_size**2`` bytes, 0.8 MB
            at 512, so the default shrinks as environments become more: 512 for up to 16, 256 for
            64, and 64 (12 kB) for 1,024 or more.
        autoreset_mode: Gymnasium's ``AutoresetMode`` for environments whose episode has ended:
            "NextStep" (the default), "SameStep" or "Disabled".
        render_envs: Indices of the environments that ``render`` draws, by default all; frames of
            the others are black and cost nothing to draw.
        threads: Maximum number of threads; by default one for each core; results are the same.
        construction: Construction as for single environments; only "rigid" is compiled.
        hull_density: Density of all cells but the wheels; only 1 is compiled.

    Raises:
        OptionError: A mode is unknown, or a count is not a positive integer.
        BodyError: A body or the grid size is malformed, or the task cannot use a body.
        TaskError: The distance score is unknown, the success radius is out of range, or only Box2D
            runs the task or a setting.
        RenderError: The picture size is out of range.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - Gymnasium's own declaration
        **VectorBase.metadata,
        "render_modes": ["rgb_array"],
    }

    def __init__(  # noqa: PLR0913 - the public call, as in gymnasium.make_vec
        self,
        num_envs: int = 1,
        max_episode_steps: int = MAX_EPISODE_STEPS,
        body: Any = None,
        grid_size: int | None = None,
        render_mode: str | None = None,
        distance_score: str = "exponential",
        success_radius: float | None = None,
        terminate_on_success: bool = False,
        render_size: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_envs: Sequence[int] | None = None,
        threads: int | None = None,
        construction: str = RIGID,
        hull_density: float = HULL_DENSITY,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise OptionError(f"render_mode must be None or 'rgb_array', got {render_mode!r}.")
        if grid_size is None:
            grid_size = grid_side(body)
        settings = TaskSettings(
            self.task.name, grid_size, distance_score, success_radius, construction, hull_density
        )
        rules = EpisodeRules(max_episode_steps, terminate_on_success, autoreset_mode)
        super().__init__(num_envs, settings, rules, body)
        n = settings.grid_size
        self.render_mode = render_mode
        self.render_size = frame_size(render_size, self.num_envs)
        self.render_envs = check_render_envs(render_envs, self.num_envs)
        workers = None if threads is None else check_count(threads, "threads")
        self._batch = EpisodeBatch(self.settings, self.num_envs, workers)
        self._robots = EnvRobots(self._batch, n)
        self._robots.put(np.arange(self.num_envs), self._first_bodies)
        self._streams = EnvStreams(self.num_envs)
        self._steps = np.zeros(self.num_envs, dtype=np.int64)
        self._is_done = np.zeros(self.num_envs, dtype=np.bool_)
        self._is_started = np.zeros(self.num_envs, dtype=np.bool_)
        self._actions = np.zeros((self.num_envs, n, n), dtype=np.float32)
        drawn = () if render_mode is None else self.render_envs
        self._pictures = Pictures(drawn, self.num_envs, self.render_size)

    @property
    def bodies(self) -> NDArray[np.int8]:
        """The present bodies, int8 ``(num_envs, n, n)``, a copy."""
        return self._robots.bodies.copy()

    @property
    def whole_bodies(self) -> NDArray[np.int8]:
        """The bodies before any damage, int8 ``(num_envs, n, n)``, a copy."""
        return self._robots.whole_bodies

    @property
    def scenarios(self) -> tuple[Scenario | None, ...]:
        """Placements of the present episodes; None where none has been started."""
        return tuple(self._batch.scenarios[env] for env in range(self.num_envs))

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """The random generator of each environment."""
        return tuple(map(self._streams.generator, range(self.num_envs)))

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The seed of each environment's generator."""
        return tuple(map(self._streams.seed_of, range(self.num_envs)))

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start episodes.

        Args:
            seed: Seed for each environment, or an integer ``s`` for ``s, s + 1, ...``. An
                environment's scenario is the one that a single environment has with its seed.
            options: Reset options: ``body``, ``region``, ``scenario`` and ``damage`` as in the
                single environments, each one for all or one for each; and ``reset_mask``, a bool
                array of the environments to reset.

        Raises:
            OptionError: An option or seed is unknown or malformed, or options exclude each other.
            BodyError: A body is malformed, or the task cannot use it.
            ScenarioError: A region is unknown, or a scenario does not fit the task.
            PerturbationError: A damage is malformed, or does not fit the grid.
        """
        self._check_open()
        request = self._requested(options)
        envs = np.flatnonzero(request.mask)
        seeds = check_seeds(seed, self.num_envs)
        self._streams.seed({i: s for i in envs.tolist() if (s := seeds[i]) is not None})
        self._robots.end(envs)
        if request.bodies is not None:
            self._robots.put(envs, request.bodies)
        pinned = request.scenarios
        self._batch.scenarios.put(list(pinned), list(pinned.values()))
        drawn = [i for i in envs.tolist() if i not in pinned]
        self._batch.scenarios.draw(drawn, self._streams, request.regions)
        self._batch.scenarios.damage(request.damages)
        self._start(envs)
        return self._observations(), self._info(request.mask)

    def _start(self, envs: Indices) -> None:
        self._robots.end(envs)
        self._robots.begin(envs)
        self._batch.start(envs)
        self._pictures.start(envs.tolist(), self._batch.scenarios.start)
        self._steps[envs] = 0
        self._is_done[envs] = False
        self._is_started[envs] = True
        self._actions[envs] = 0.0
        self._robots.damage(envs, self._steps)

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[
        NDArray[np.float32],
        NDArray[np.float64],
        NDArray[np.bool_],
        NDArray[np.bool_],
        dict[str, Any],
    ]:
        """Advance every environment by one step, or reset it as ``autoreset_mode`` demands.

        Args:
            actions: Gas per cell, shape ``(num_envs, n, n)``; read in wheel cells, clipped to
                [-1, 1].

        Raises:
            ResetNeeded: An environment has no episode, or, with autoreset disabled, one that has
                ended.
            ActionError: The actions have the wrong shape, or values that are not finite.
        """
        self._check_open()
        if not self._is_started.all():
            first = int(np.argmin(self._is_started))
            raise ResetNeeded(f"Call reset() before step(): environment {first} has no episode.")
        was_done = self._is_done
        if self.autoreset_mode is AutoresetMode.DISABLED and was_done.any():
            raise ResetNeeded(
                f"Episodes have ended in {int(was_done.sum())} environments, the first of them "
                f"{int(np.argmax(was_done))}; reset them with options={{'reset_mask': ...}}."
            )
        n = self.settings.grid_size
        self._actions = check_action(actions, (self.num_envs, n, n), "one gas value per cell")
        self._robots.silence(self._actions, self._steps)
        flat = self._actions.reshape(self.num_envs, n * n)
        is_running = ~was_done
        rewards = self._batch.step(flat, is_running)
        self._steps += 1
        self._robots.damage(np.flatnonzero(is_running), self._steps)
        if was_done.any():
            envs = np.flatnonzero(was_done)
            self._batch.scenarios.draw(envs.tolist(), self._streams)
            self._start(envs)
        if self.render_mode is not None:
            self._pictures.extend(self._batch.poses, is_running)
        terminated = np.zeros(self.num_envs, dtype=np.bool_)
        if self.terminate_on_success:
            terminated = self._batch.success
        truncated = self._steps >= self._step_limit
        self._is_done = terminated | truncated
        info = self._finish() if self.autoreset_mode is AutoresetMode.SAME_STEP else {}
        info.update(self._info(check_mask(None, self.num_envs)))
        return self._observations(), rewards, terminated, truncated, info

    def _finish(self) -> dict[str, Any]:
        """Reset environments whose episode has just ended; return their last info."""
        done = self._is_done
        if not done.any():
            return {}
        envs = np.flatnonzero(done)
        observations = self._observations()
        last = np.full(self.num_envs, None, dtype=object)
        for env in envs:
            last[env] = observations[env]
        info = {
            "final_obs": last,
            "_final_obs": done.copy(),
            "final_info": self._info(done),
            "_final_info": done.copy(),
        }
        self._batch.scenarios.draw(envs.tolist(), self._streams)
        self._start(envs)
        return info

    def _observations(self) -> NDArray[np.float32]:
        return self._robots.observations(self._steps)

    def _info(self, mask: NDArray[np.bool_]) -> dict[str, Any]:
        """Return the infos of the environments in ``mask``."""
        return batch_info({**self._robots.infos(), **self._batch.infos()}, mask)

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Return an RGB frame for each environment; None without a render mode.

        Those not in ``render_envs`` are black, since Gymnasium's wrappers expect one for each.

        Raises:
            ResetNeeded: An environment in ``render_envs`` has no episode.
        """
        if self.render_mode is None:
            gymnasium.logger.warn("render() needs an environment with render_mode='rgb_array'.")
            return None
        return self._pictures.frames(self.scene)

    def scene(self, env: int) -> Scene:
        """Return the scene of one environment; its path is known if it is drawn.

        Raises:
            ResetNeeded: The environment has no episode.
        """
        if self._batch.scenarios[env] is None:
            raise ResetNeeded("Call reset() before render(): there is nothing to show yet.")
        body = self._robots.bodies[env].copy()
        return self._batch.scene(env, body, self._actions[env].copy(), self._pictures.path(env))

    def close_extras(self, **kwargs: Any) -> None:
        """End the threads."""
        self._batch.close()


class LightChaseVectorEnv(RobotVectorEnv):
    """Many robots, each driving to a light in the open; see ``LightChaseEnv``."""

    task = LIGHT_CHASE


class ObstacleVectorEnv(RobotVectorEnv):
    """Many robots, each driving to a light through a passage; see ``ObstacleEnv``."""

    task = OBSTACLE


class CarryBallVectorEnv(RobotVectorEnv):
    """Many robots, each pushing a ball to a target area; see ``CarryBallEnv``."""

    task = CARRY_BALL


class ObstacleTouchVectorEnv(RobotVectorEnv):
    """Many robots, each feeling for a passage to a light; see ``ObstacleTouchEnv``."""

    task = OBSTACLE_TOUCH
