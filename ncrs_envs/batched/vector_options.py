"""Options and infos of the vector environments, for all environments at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from ncrs_envs.interface import OptionError, check_damage, from_tensor
from ncrs_envs.perturbations import Damage
from ncrs_envs.scenario import Scenario, ScenarioError, check_region
from ncrs_envs.tasks import Task, TaskError, TaskSettings

NO_STEP_LIMIT = -1
"""Value of ``max_episode_steps`` for no truncation, as in ``gymnasium.make``."""


class MaskTypeError(OptionError, TypeError):
    """A reset mask that is not a numpy array of bools (Gymnasium raises TypeError here)."""


def check_compiled(settings: TaskSettings) -> None:
    """Raise ``TaskError`` if only Box2D runs the task or a setting."""
    if settings.needs_box2d:
        raise TaskError(
            f"{settings.name} {settings.not_compiled}, which only Box2D runs: use "
            f"gymnasium.make_vec({settings.task.env_id!r}, vectorization_mode='sync')."
        )


def check_mask(mask: Any, count: int) -> NDArray[np.bool_]:
    """Return ``options["reset_mask"]``, shape ``(count,)``; all True for None.

    Raises:
        MaskTypeError: The mask is not a numpy array of bools.
        OptionError: The mask has the wrong shape, or selects nothing.
    """
    if mask is None:
        return np.ones(count, dtype=np.bool_)
    mask = from_tensor(mask)
    if not isinstance(mask, np.ndarray):
        raise MaskTypeError(f"reset_mask must be a numpy array, got {type(mask).__name__}.")
    if mask.dtype != np.bool_:
        raise MaskTypeError(f"reset_mask must have dtype bool, got {mask.dtype}.")
    if mask.shape != (count,):
        raise OptionError(f"reset_mask must have shape ({count},), got {mask.shape}.")
    if not mask.any():
        raise OptionError("reset_mask must select at least one environment, got all False.")
    return mask


def _for_each(value: Any, kind: type | tuple[type, ...], count: int) -> list[Any]:
    """Return one value per environment: ``value`` if it is a ``kind`` or None, else its items."""
    if value is None or isinstance(value, kind) or not isinstance(value, np.ndarray | Sequence):
        return [value] * count
    if len(value) != count:
        raise OptionError(
            f"An option must be one value for all or one for each of {count} environments, "
            f"got {len(value)} values."
        )
    return list(value)


def check_regions(region: Any, count: int) -> list[int | None]:
    """Return a region, or None for a random one, for each environment.

    Raises:
        OptionError: A sequence has the wrong length.
        ScenarioError: A region is unknown.
    """
    regions = _for_each(from_tensor(region), (int, np.integer), count)
    return [None if region is None else check_region(region) for region in regions]


def check_scenarios(scenario: Any, task: Task, grid_size: int, count: int) -> list[Scenario | None]:
    """Return a scenario, or None for a random one, for each environment.

    Raises:
        OptionError: A sequence has the wrong length.
        ScenarioError: A value is not a ``Scenario``, or does not fit the task.
    """
    scenarios = _for_each(scenario, Scenario, count)
    for one in {id(s): s for s in scenarios if s is not None}.values():
        if not isinstance(one, Scenario):
            raise ScenarioError(
                f"scenario must be an ncrs_envs.Scenario, got {type(one).__name__}."
            )
        one.check(task, grid_size)
    return scenarios


def check_damages(damage: Any, grid_size: int, count: int) -> list[Damage | None]:
    """Return a damage, or None, for each environment.

    Raises:
        OptionError: A sequence has the wrong length.
        PerturbationError: A value is not a ``Damage``, or does not fit the grid.
    """
    damages = _for_each(damage, Damage, count)
    return [None if one is None else check_damage(one, grid_size) for one in damages]


def check_seeds(seed: Any, count: int) -> list[int | None]:
    """Return a seed, or None to keep the present generator, for each environment.

    An integer ``s`` stands for ``s, s + 1, ...``, as in Gymnasium.

    Raises:
        OptionError: A sequence has the wrong length, or a seed has another type or is negative.
    """
    if seed is None:
        return [None] * count
    seed = from_tensor(seed)
    if isinstance(seed, int | np.integer) and not isinstance(seed, bool):
        return [_check_seed(seed) + i for i in range(count)]
    if not isinstance(seed, np.ndarray | Sequence) or isinstance(seed, str):
        raise OptionError(f"seed must be None, an integer or a sequence of them, got {seed!r}.")
    if len(seed) != count:
        raise OptionError(f"seed must hold one for each of {count} environments, got {len(seed)}.")
    return [None if s is None else _check_seed(s) for s in seed]


def _check_seed(seed: Any) -> int:
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer):
        raise OptionError(f"A seed must be an integer, got {seed!r}.")
    if seed < 0:
        raise OptionError(f"A seed must not be negative, got {seed}.")
    return int(seed)


def check_count(value: Any, name: str) -> int:
    """Return a positive integer, or raise ``OptionError``."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise OptionError(f"{name} must be a positive integer, got {value!r}.")
    return int(value)


def without_mask(options: Any) -> Any:
    """Return reset options without the mask, which the single environments do not have."""
    if isinstance(options, dict):
        return {name: value for name, value in options.items() if name != "reset_mask"}
    return options


def check_autoreset_mode(mode: str | AutoresetMode) -> AutoresetMode:
    """Return the mode, or raise ``OptionError`` if it is unknown."""
    try:
        return AutoresetMode(mode)
    except ValueError as error:
        known = [known.value for known in AutoresetMode]
        raise OptionError(f"autoreset_mode must be one of {known}, got {mode!r}.") from error


def batch_info(values: dict[str, NDArray[Any]], mask: NDArray[np.bool_]) -> dict[str, Any]:
    """Return the infos of the environments in ``mask``, batched as in Gymnasium.

    Each key has a companion ``_key``, the mask of the environments that it is for. Values of the
    others are set to 0 in ``values`` itself.
    """
    everywhere = bool(mask.all())
    info: dict[str, Any] = {}
    for name, value in values.items():
        if not everywhere:
            value[~mask] = 0
        info[name] = value
        info[f"_{name}"] = mask.copy()
    return info


def check_step_limit(steps: Any) -> int:
    """Return the number of steps of an episode; raise ``OptionError`` unless positive or -1."""
    if isinstance(steps, int) and steps == NO_STEP_LIMIT:
        return int(np.iinfo(np.int64).max)
    return check_count(steps, "max_episode_steps")
