"""What vector environments have in common, on whatever device they are simulated."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ClosedEnvironmentError
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from ncrs_envs.batched.vector_options import (
    check_autoreset_mode,
    check_compiled,
    check_count,
    check_damages,
    check_mask,
    check_regions,
    check_scenarios,
    check_step_limit,
    without_mask,
)
from ncrs_envs.bodies import check_bodies
from ncrs_envs.interface import check_flag, check_options, from_tensor
from ncrs_envs.perturbations import Damage
from ncrs_envs.physics import DT
from ncrs_envs.scenario import Scenario
from ncrs_envs.tasks import Task, TaskSettings, default_body

if TYPE_CHECKING:
    _BaseEnv = VectorEnv[Any, Any, Any]
else:
    _BaseEnv = VectorEnv


class EpisodeRules(NamedTuple):
    """Arguments that decide how episodes end and are followed by others, as they were given."""

    max_episode_steps: int
    terminate_on_success: bool
    autoreset_mode: str | AutoresetMode


class ResetRequest(NamedTuple):
    """Checked reset options, for the environments in ``mask``."""

    mask: NDArray[np.bool_]
    """True for the environments to reset, ``(num_envs,)``."""
    bodies: NDArray[np.int8] | None
    """A body for each environment in the mask; None to keep theirs."""
    regions: list[int | None]
    """A region, or None for a random one, for every environment."""
    scenarios: dict[int, Scenario]
    """Scenarios by environment, of those that are given one."""
    damages: dict[int, Damage]
    """Damages by environment, of those that are given one."""


class VectorBase(_BaseEnv):
    """Number, spaces, rules and first bodies of vector environments.

    Args:
        num_envs: Number of environments.
        settings: The task and its settings.
        rules: How episodes end.
        body: One body for all, or one for each; None for the task's own.

    Raises:
        OptionError: A mode is unknown, or a count is not a positive integer.
        BodyError: A body is malformed, or the task cannot use it.
        TaskError: Only Box2D runs the task or a setting.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - Gymnasium's own declaration
        "render_modes": [],
        "render_fps": round(1.0 / DT),
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }
    task: ClassVar[Task]
    _spec: EnvSpec | None = None

    def __init__(
        self, num_envs: int, settings: TaskSettings, rules: EpisodeRules, body: Any
    ) -> None:
        self.num_envs = check_count(num_envs, "num_envs")
        check_compiled(settings)
        self.settings = settings
        self.terminate_on_success = check_flag(rules.terminate_on_success, "terminate_on_success")
        self.autoreset_mode = check_autoreset_mode(rules.autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self._step_limit = check_step_limit(rules.max_episode_steps)
        n = settings.grid_size
        self.single_observation_space = gymnasium.spaces.Box(0.0, 1.0, (n, n), np.float32)
        self.single_action_space = gymnasium.spaces.Box(-1.0, 1.0, (n, n), np.float32)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._first_bodies = check_bodies(
            default_body(self.task, n) if body is None else body,
            self.task,
            n,
            check_mask(None, self.num_envs),
        )

    @property
    def spec(self) -> EnvSpec | None:
        """The spec that this was made from, its body as nested lists and so on, for JSON."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        if spec is not None:
            plain = dict(spec.kwargs)
            if plain.get("body") is not None:
                plain["body"] = np.asarray(from_tensor(plain["body"])).tolist()
            if "device" in plain:
                plain["device"] = str(plain["device"])
            spec = copy.copy(spec)
            spec.kwargs = plain
        self._spec = spec

    def _requested(self, options: dict[str, Any] | None) -> ResetRequest:
        """Check reset options; the errors are those of ``reset``."""
        given = dict(check_options(without_mask(options)))
        count, n = self.num_envs, self.settings.grid_size
        mask = check_mask(options.get("reset_mask") if options else None, count)
        body = given.get("body")
        bodies = None if body is None else check_bodies(body, self.task, n, mask)
        regions = check_regions(given.get("region"), count)
        scenarios = check_scenarios(given.get("scenario"), self.task, n, count)
        damages = check_damages(given.get("damage"), n, count)
        chosen = np.flatnonzero(mask).tolist()
        return ResetRequest(
            mask,
            bodies,
            regions,
            {i: scenario for i in chosen if (scenario := scenarios[i]) is not None},
            {i: damage for i in chosen if (damage := damages[i]) is not None},
        )

    def _check_open(self) -> None:
        if self.closed:
            raise ClosedEnvironmentError("This environment has been closed; make a new one.")
