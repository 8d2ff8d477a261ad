"""Gymnasium vector environments on a GPU, for learners that live there.

``gymnasium.make_vec(id, num_envs, device="cuda")`` makes them. Actions are tensors on the GPU;
observations, rewards and infos are tensors there, which other libraries take through DLPack. In a
step nothing comes to the CPU but whether all actions are finite: episodes that end are followed by
others from random streams on the GPU.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NoReturn

import gymnasium
import numpy as np
import torch
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from ncrs_envs.batched.env_streams import EnvStreams
from ncrs_envs.batched.records import scenario_records
from ncrs_envs.batched.sampling import RANDOM_REGION
from ncrs_envs.batched.scenario_table import Indices
from ncrs_envs.batched.vector_base import EpisodeRules, VectorBase
from ncrs_envs.batched.vector_options import check_seeds
from ncrs_envs.bodies import grid_side
from ncrs_envs.body import HULL_DENSITY, sensor_mask, wheel_mask
from ncrs_envs.cuda.devices import check_device, on_device
from ncrs_envs.cuda.fleet import FleetMemory
from ncrs_envs.cuda.kernels import DRAW, KEEP, LEAVE
from ncrs_envs.cuda.tensors import SharedMemory, check_device_name
from ncrs_envs.interface import OptionError
from ncrs_envs.tasks import MAX_EPISODE_STEPS, RIGID, TaskError, TaskSettings


class NoGeneratorError(OptionError, AttributeError):
    """A generator of random numbers that is asked of environments on a GPU."""


class DeviceVectorEnv(VectorBase):
    """Modular robots on a GPU, one in each environment; each task has a subclass.

    Arguments, options, infos and their meaning are those of ``RobotVectorEnv``, without drawing,
    damage and noise. Every info is there in every step; with ``SAME_STEP`` ``final_obs`` and
    ``final_info`` are, too, and their masks tell which environments they are for. Masks, bodies and
    what follows from bodies are the same tensors in many infos, and not to be changed.

    Args:
        num_envs: Number of environments.
        device: The GPU, "cuda" or "cuda:INDEX".
        max_episode_steps: Steps after which episodes are truncated; -1 for never.
        body: One body for all, or one for each, shape ``(num_envs, n, n)``.
        grid_size: Side of the body grid; by default that of ``body``, or 5.
        render_mode: None: nothing is drawn on a GPU.
        distance_score: Kind of distance score, "exponential" or "inverse_square".
        success_radius: Success radius in units; by default the task's own.
        terminate_on_success: True to end an episode when it succeeds.
        autoreset_mode: Gymnasium's ``AutoresetMode``.
        construction: Construction as for single environments; only "rigid" is compiled.
        hull_density: Density of all cells but the wheels; only 1 is compiled.

    Raises:
        OptionError: A mode or the device is unknown, a count is not a positive integer, or the
            environments do not fit into the GPU's memory.
        BodyError: A body or the grid size is malformed, or the task cannot use a body.
        TaskError: The distance score is unknown, the success radius is out of range, or the task
            or a setting needs Box2D or Python.
        UnusableGPUError: The GPU is not there, too old, or taken.
        FailedGPUError: Its memory was used up, by others too, or it failed.
    """

    _fleet: FleetMemory | None = None

    def __init__(  # noqa: PLR0913 - the public call, as in gymnasium.make_vec
        self,
        num_envs: int = 1,
        device: Any = "cuda",
        max_episode_steps: int = MAX_EPISODE_STEPS,
        body: Any = None,
        grid_size: int | None = None,
        render_mode: str | None = None,
        distance_score: str = "exponential",
        success_radius: float | None = None,
        terminate_on_success: bool = False,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        construction: str = RIGID,
        hull_density: float = HULL_DENSITY,
    ) -> None:
        if render_mode is not None:
            raise OptionError(
                f"render_mode must be None on a GPU, got {render_mode!r}: leave device out."
            )
        if self.task.place is not None:
            raise TaskError(
                f"{self.task.name} draws its placements in Python, which no GPU runs: leave "
                "device out."
            )
        if grid_size is None:
            grid_size = grid_side(body)
        settings = TaskSettings(
            self.task.name, grid_size, distance_score, success_radius, construction, hull_density
        )
        rules = EpisodeRules(max_episode_steps, terminate_on_success, autoreset_mode)
        super().__init__(num_envs, settings, rules, body)
        self.render_mode = None
        self._index = check_device_name(device)
        check_device(self._index)
        shared = SharedMemory(self._index)
        self.device = shared.device
        self._shared = shared
        self._resets_at_once = self.autoreset_mode is AutoresetMode.SAME_STEP
        ends = (self._step_limit, self.terminate_on_success, self._resets_at_once)
        with on_device(self._index):
            self._fleet = FleetMemory(settings, self.num_envs, ends, shared)
            everywhere = torch.ones(self.num_envs, dtype=torch.bool, device=self.device)
        self._everywhere = everywhere
        self._action: torch.Tensor | None = None
        self._streams = EnvStreams(self.num_envs)
        self._is_started = np.zeros(self.num_envs, dtype=np.bool_)
        n = settings.grid_size
        self._bodies = np.zeros((self.num_envs, n, n), dtype=np.int8)
        self._put_bodies(np.arange(self.num_envs), self._first_bodies)

    def _put_bodies(self, envs: Indices, bodies: NDArray[np.int8]) -> None:
        with on_device(self._index):
            self._memory.set_bodies(envs, bodies)
        self._bodies[envs] = bodies
        sensors, wheels = sensor_mask(self._bodies), wheel_mask(self._bodies)
        shown = {"body": self._bodies, "sensor_mask": sensors, "wheel_mask": wheels}
        self._body_infos = {name: self._shared.tensor(array) for name, array in shown.items()}

    @property
    def _memory(self) -> FleetMemory:
        self._check_open()
        assert self._fleet is not None
        return self._fleet

    @property
    def bodies(self) -> NDArray[np.int8]:
        """The bodies, int8 ``(num_envs, n, n)``, a copy on the CPU."""
        return self._bodies.copy()

    @property  # type: ignore[misc]
    def np_random(self) -> NoReturn:  # type: ignore[override]
        """Missing here, since the random streams are on the GPU."""
        raise NoGeneratorError("The random streams of these environments are on the GPU.")

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The seed of each environment's stream."""
        return tuple(map(self._streams.seed_of, range(self.num_envs)))

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[torch.Tensor, dict[str, Any]]:
        """Start episodes; arguments and errors as of ``RobotVectorEnv.reset``, but for damage."""
        self._check_open()
        request = self._requested(options)
        mask, pinned = request.mask, request.scenarios
        if request.damages or any(scenario.is_perturbed for scenario in pinned.values()):
            raise OptionError("Nothing is damaged or disturbed on a GPU: leave device out.")
        regions = [RANDOM_REGION if region is None else region for region in request.regions]
        envs = np.flatnonzero(mask)
        self._seed(envs, seed)
        if request.bodies is not None:
            self._put_bodies(envs, request.bodies)
        kinds = np.where(mask, DRAW, LEAVE).astype(np.int8)
        kinds[list(pinned)] = KEEP
        with on_device(self._index):
            if pinned:
                rows = scenario_records(list(pinned.values()), self.settings.grid_size)
                self._memory.set_scenarios(np.array(list(pinned)), rows)
            self._memory.start(kinds, np.array(regions, dtype=np.int64))
        self._is_started |= mask
        shown = None if mask.all() else self._shared.tensor(mask)
        return self._observations(), self._infos_of(self._memory.readings, shown)

    def _seed(self, envs: Indices, seed: Any) -> None:
        """Seed environments, and those that have no seed yet with numbers that nobody knows."""
        is_fresh = ~self._is_started[envs]
        if seed is not None:
            seeds = check_seeds(seed, self.num_envs)
            given = {i: s for i in envs.tolist() if (s := seeds[i]) is not None}
            self._streams.seed(given)
            is_fresh |= np.isin(envs, list(given))
        fresh = envs[is_fresh]
        if len(fresh):
            with on_device(self._index):
                self._memory.set_streams(fresh, self._streams.take(fresh.tolist()))

    def step(
        self, actions: Any
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor, dict[str, Any]]:
        """Advance every environment by one step, or reset it as ``autoreset_mode`` demands.

        Args:
            actions: Gas per cell, a tensor ``(num_envs, n, n)`` on the GPU, or anything there with
                ``__dlpack__``; read in wheel cells, clipped to [-1, 1].

        Returns:
            Observations, float32 ``(num_envs, n, n)``; rewards, float64 ``(num_envs,)``;
            terminated and truncated, bool ``(num_envs,)``; and infos, tensors, too.

        Raises:
            ResetNeeded: An environment has no episode, or, with autoreset disabled, one that has
                ended.
            ActionError: The actions are not on the GPU, have the wrong shape, or values that are
                not finite.
        """
        memory = self._memory
        turn = memory.turn
        if not self._is_started.all():
            first = int(np.argmin(self._is_started))
            raise ResetNeeded(f"Call reset() before step(): environment {first} has no episode.")
        if self.autoreset_mode is AutoresetMode.DISABLED and bool(turn["is_done"].any()):
            done = turn["is_done"].nonzero().flatten()
            raise ResetNeeded(
                f"Episodes have ended in {len(done)} environments, the first of them "
                f"{int(done[0])}; reset them with options={{'reset_mask': ...}}."
            )
        n = self.settings.grid_size
        with on_device(self._index):
            # Kept until the next step: another library might reuse its memory before it is read.
            self._action = self._shared.action(actions, (self.num_envs, n, n))
            memory.step(self._action)
        info: dict[str, Any] = {}
        if self._resets_at_once:
            ended = turn["terminated"] | turn["truncated"]
            last = memory.last["observations"].reshape(-1, n, n)
            info["final_obs"] = last.masked_fill(~ended[:, None, None], 0.0)
            info["final_info"] = self._infos_of(memory.last, ended)
            info["_final_obs"] = info["_final_info"] = ended
        info.update(self._infos_of(memory.readings, None))
        results = (turn[name].clone() for name in ("rewards", "terminated", "truncated"))
        rewards, terminated, truncated = results
        return self._observations(), rewards, terminated, truncated, info

    def _observations(self) -> torch.Tensor:
        n = self.settings.grid_size
        return self._memory.readings["observations"].reshape(-1, n, n).clone()

    def _infos_of(
        self, readings: dict[str, torch.Tensor], mask: torch.Tensor | None
    ) -> dict[str, Any]:
        """Return the infos of the environments in ``mask``, of all for None; 0 for the others."""
        infos = {"pose": readings["poses"], "success": readings["success"]}
        to_goal, to_target = readings["distances"].unbind(dim=1)
        if self.task.has_ball:
            infos |= {"distance_to_ball": to_goal, "ball_to_target": to_target}
        else:
            infos["distance"] = to_goal
        if self.task.has_walls:
            infos["crossed"] = readings["crossed"]
        made: dict[str, Any]
        if mask is None:
            made = {name: value.clone() for name, value in infos.items()} | self._body_infos
        else:
            made = {
                name: value.masked_fill(~mask.reshape(-1, *[1] * (value.ndim - 1)), 0)
                for name, value in (self._body_infos | infos).items()
            }
        shown = self._everywhere if mask is None else mask
        return made | {f"_{name}": shown for name in made}

    def render(self) -> None:
        """Return None, with a warning: nothing is drawn on a GPU."""
        gymnasium.logger.warn("Environments on a GPU draw nothing; make them without device.")

    def __getstate__(self) -> NoReturn:
        raise TypeError("Environments on a GPU can be neither pickled nor copied; make others.")

    def close_extras(self, **kwargs: Any) -> None:
        """Release the memory on the GPU."""
        if self._fleet is not None:  # as it is where the environments could not be made
            with on_device(self._index):
                self._fleet = self._action = None
