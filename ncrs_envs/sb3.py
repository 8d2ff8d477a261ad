"""Stable-Baselines3 on the batched simulator: a ``VecEnv`` over thousands of robots at once.

Needs the extra ``sb3``. Nothing else of this package imports this module.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from ncrs_envs.body import parse_body
from ncrs_envs.interface import RESET_OPTIONS, OptionError
from ncrs_envs.wrappers.signals import ViewError
from ncrs_envs.wrappers.vector import check_on_cpu

if TYPE_CHECKING:
    _Envs = VectorEnv[Any, Any, Any]
else:
    _Envs = VectorEnv

Indices = int | Iterable[int] | None


class SB3VecEnv(VecEnv):
    """Vector environments as Stable-Baselines3 takes them.

    Episodes restart in the step in which they end. That step's info then holds what SB3 expects:
    ``terminal_observation``, ``TimeLimit.truncated`` and ``is_success``, beside the last info of
    the episode. The infos of other steps are empty, since a dict for each of a thousand robots
    takes longer than simulating them; ``infos`` has all of them as arrays.

    Args:
        envs: vector environments of this suite, with or without ``ncrs_envs.wrappers.vector``,
            made with ``autoreset_mode="SameStep"``.

    Raises:
        ViewError: another autoreset mode.
    """

    def __init__(self, envs: _Envs) -> None:
        check_on_cpu(envs)
        if envs.metadata.get("autoreset_mode") is not AutoresetMode.SAME_STEP:
            raise ViewError(
                "SB3VecEnv needs environments that restart in the step in which they end; make "
                "them with gymnasium.make_vec(..., autoreset_mode='SameStep'), got "
                f"{envs.metadata.get('autoreset_mode')}."
            )
        self.envs = envs
        self.infos: dict[str, Any] = {}
        """Infos of the last step or reset as arrays over the environments."""
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)
        self._actions: Any = None

    def reset(self) -> Any:
        """Start all episodes, with the seeds and options that were set before."""
        seeds = None if all(seed is None for seed in self._seeds) else list(self._seeds)
        observations, self.infos = self.envs.reset(
            seed=seeds,  # type: ignore[arg-type]  # one for each, as Gymnasium's own take them
            options=_joined(self._options),
        )
        self.reset_infos = [self._info(self.infos, env) for env in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions for ``step_wait``."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Advance every environment one control step."""
        observations, rewards, terminated, truncated, self.infos = self.envs.step(self._actions)
        dones = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for env in np.flatnonzero(dones).tolist():
            last = self._info(self.infos["final_info"], env)
            infos[env] = {
                **last,
                "terminal_observation": self.infos["final_obs"][env],
                "TimeLimit.truncated": bool(truncated[env] and not terminated[env]),
                "is_success": bool(last["success"]),
            }
            self.reset_infos[env] = self._info(self.infos, env)
        return observations, rewards.astype(np.float32), dones, infos

    @staticmethod
    def _info(infos: dict[str, Any], env: int) -> dict[str, Any]:
        """Info of one environment out of the batched ones."""
        names = [name for name in infos if f"_{name}" in infos and not name.startswith("final_")]
        return {name: infos[name][env] for name in names}

    def close(self) -> None:
        """End the environments' threads or processes."""
        self.envs.close()

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Frames of the environments that are rendered; see ``render_envs`` of the vector env."""
        frames = self.envs.render()
        if frames is None:
            return [None]
        drawn = getattr(self.envs.unwrapped, "render_envs", range(self.num_envs))
        return [frames[env] for env in drawn]  # type: ignore[misc]

    def _chosen(self, indices: Indices) -> list[int]:
        return [int(index) for index in self._get_indices(indices)]

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """Value of an attribute for each environment.

        ``body`` and ``scenario`` are each environment's own; others are those of all.

        Raises:
            AttributeError: no such attribute.
        """
        chosen = self._chosen(indices)
        base: Any = self.envs.unwrapped
        if attr_name in ("body", "scenario"):
            values = base.bodies if attr_name == "body" else base.scenarios
            return [values[index] for index in chosen]
        owner = self.envs if hasattr(self.envs, attr_name) else base
        return [getattr(owner, attr_name)] * len(chosen)

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        """Refuse: settings are those of all environments, and fixed when they are made.

        Raises:
            OptionError: always; bodies, regions and scenarios are set by ``set_options``.
        """
        raise OptionError(
            f"{attr_name} cannot be set on environments that are simulated together; give it to "
            f"gymnasium.make_vec, or set_options with one of {list(RESET_OPTIONS)} before reset()."
        )

    def env_method(
        self, method_name: str, *method_args: Any, indices: Indices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method that takes an environment's index first, such as ``scene``.

        Raises:
            AttributeError: no such method.
        """
        method = getattr(self.envs.unwrapped, method_name)
        return [method(env, *method_args, **method_kwargs) for env in self._chosen(indices)]

    def env_is_wrapped(self, wrapper_class: type[Any], indices: Indices = None) -> list[bool]:
        """Report whether the vector environments are wrapped in that class, for each of them."""
        layer: Any = self.envs
        found = isinstance(layer, wrapper_class)
        while not found and hasattr(layer, "env"):
            layer = layer.env
            found = isinstance(layer, wrapper_class)
        return [found] * len(self._chosen(indices))


def _joined(options: Sequence[dict[str, Any]]) -> dict[str, Any] | None:
    """Reset options of single environments as those of all; None without any.

    Raises:
        OptionError: a body for some environments only.
    """
    names = sorted({name for one in options for name in one})
    joined: dict[str, Any] = {name: [one.get(name) for one in options] for name in names}
    bodies = joined.get("body")
    if bodies is not None:
        if any(body is None for body in bodies):
            raise OptionError("Give the option body to all environments, or to none.")
        joined["body"] = np.stack([parse_body(body) for body in bodies])
    return joined or None
