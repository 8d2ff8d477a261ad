"""What the vector environments take and give, for all environments at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from ncrs_envs.body import DEFAULT_GRID_SIZE, BodyError, parse_body
from ncrs_envs.interface import OptionError
from ncrs_envs.scenario import Scenario, ScenarioError, check_region
from ncrs_envs.tasks import Task

RENDERED_BY_DEFAULT = 4
NO_STEP_LIMIT = -1
"""As ``max_episode_steps``: episodes are never truncated (as in ``gymnasium.make``)."""


class MaskTypeError(OptionError, TypeError):
    """A reset mask that is not a numpy array of bools (Gymnasium raises TypeError here)."""


def check_mask(mask: Any, count: int) -> NDArray[np.bool_]:
    """Return ``options["reset_mask"]``, shape ``(count,)``; all True for None.

    Raises:
        MaskTypeError: not a numpy array of bools.
        OptionError: wrong shape, or nothing to reset.
    """
    if mask is None:
        return np.ones(count, dtype=np.bool_)
    if not isinstance(mask, np.ndarray):
        raise MaskTypeError(f"reset_mask must be a numpy array, got {type(mask).__name__}.")
    if mask.dtype != np.bool_:
        raise MaskTypeError(f"reset_mask must have dtype bool, got {mask.dtype}.")
    if mask.shape != (count,):
        raise OptionError(f"reset_mask must have shape ({count},), got {mask.shape}.")
    if not mask.any():
        raise OptionError("reset_mask must select at least one environment, got all False.")
    return mask


def check_bodies(
    body: Any, task: Task, grid_size: int, mask: NDArray[np.bool_]
) -> NDArray[np.int8]:
    """Bodies of the environments in ``mask``.

    Args:
        body: one body in any form that ``parse_body`` takes, or an integer array of one body for
            each environment, shape ``(count, n, n)``.
        task: must be able to use them.
        grid_size: their required side.
        mask: which environments they are for, shape ``(count,)``; the others' are not looked at.

    Returns:
        int8 ``(1, n, n)`` if there is one body for all, else ``(selected, n, n)``.

    Raises:
        BodyError: a malformed body, or one that the task cannot use; names the environment.
    """
    if not (isinstance(body, np.ndarray | Sequence) and np.ndim(body) == 3):
        grid = parse_body(body, grid_size)
        task.check_body(grid)
        return grid[None]
    bodies = np.asarray(body)
    if len(bodies) != len(mask):
        raise BodyError(
            f"body must hold one body for each of {len(mask)} environments, or be a single one, "
            f"got {len(bodies)}, shape {bodies.shape}."
        )
    if bodies.shape[1:] != (grid_size, grid_size) or bodies.dtype.kind not in "iu":
        parse_body(bodies[0], grid_size)  # says what is wrong with all of them
    chosen = bodies[mask]
    # Codes beyond int8 would wrap around to known ones.
    fits = ((chosen >= 0) & (chosen <= np.iinfo(np.int8).max)).all(axis=(1, 2))
    usable = fits & task.is_valid(chosen)
    if not usable.all():
        first = int(np.flatnonzero(mask)[np.argmin(usable)])
        try:
            task.check_body(parse_body(bodies[first], grid_size))
        except BodyError as error:
            raise BodyError(f"Environment {first}: {error}") from error
    return np.asarray(chosen, dtype=np.int8)


def _for_each(value: Any, kind: type | tuple[type, ...], count: int) -> list[Any]:
    """``value`` once for each environment: itself if it is of ``kind`` or None, else its items."""
    if value is None or isinstance(value, kind) or not isinstance(value, np.ndarray | Sequence):
        return [value] * count
    if len(value) != count:
        raise OptionError(
            f"Options for single environments must hold one value for each of {count}, "
            f"got {len(value)}."
        )
    return list(value)


def check_regions(region: Any, count: int) -> list[int | None]:
    """A region, or None for a random one, for each environment.

    Raises:
        OptionError: a sequence of the wrong length.
        ScenarioError: an unknown region.
    """
    regions = _for_each(region, (int, np.integer), count)
    return [None if region is None else check_region(region) for region in regions]


def check_scenarios(scenario: Any, task: Task, grid_size: int, count: int) -> list[Scenario | None]:
    """A scenario, or None for a random one, for each environment.

    Raises:
        OptionError: a sequence of the wrong length.
        ScenarioError: not a ``Scenario``, or one that does not fit the task.
    """
    scenarios = _for_each(scenario, Scenario, count)
    for one in {id(s): s for s in scenarios if s is not None}.values():
        if not isinstance(one, Scenario):
            raise ScenarioError(
                f"scenario must be an ncrs_envs.Scenario, got {type(one).__name__}."
            )
        one.check(task, grid_size)
    return scenarios


def check_seeds(seed: Any, count: int) -> list[int | None]:
    """A seed, or None to go on with the present generator, for each environment.

    An integer ``s`` stands for ``s, s + 1, ...``, as in Gymnasium.

    Raises:
        OptionError: a sequence of the wrong length, or something else.
    """
    if seed is None:
        return [None] * count
    if isinstance(seed, int | np.integer) and not isinstance(seed, bool):
        return [int(seed) + i for i in range(count)]
    if not isinstance(seed, np.ndarray | Sequence) or isinstance(seed, str):
        raise OptionError(f"seed must be None, an integer or one for each env, got {seed!r}.")
    if len(seed) != count:
        raise OptionError(f"seed must hold one for each of {count} environments, got {len(seed)}.")
    return [None if s is None else int(s) for s in seed]


def check_count(value: Any, name: str) -> int:
    """Return a positive integer, or raise ``OptionError``."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise OptionError(f"{name} must be a positive integer, got {value!r}.")
    return int(value)


def grid_side(body: Any) -> int:
    """Side of the grid that a body, or an array of them, has."""
    if body is None:
        return DEFAULT_GRID_SIZE
    if isinstance(body, np.ndarray | Sequence) and np.ndim(body) == 3:
        body = body[0]
    return int(parse_body(body).shape[0])


def without_mask(options: Any) -> Any:
    """Reset options less the reset mask, which the single environments do not have."""
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


def check_render_envs(envs: Sequence[int] | None, count: int) -> list[int]:
    """Indices of the environments to draw; by default the first few."""
    if envs is None:
        return list(range(min(count, RENDERED_BY_DEFAULT)))
    indices = [int(env) for env in envs]
    if any(not 0 <= env < count for env in indices):
        raise OptionError(f"render_envs must hold indices from 0 to {count - 1}, got {indices}.")
    return indices


def batch_info(values: dict[str, NDArray[Any]], mask: NDArray[np.bool_]) -> dict[str, Any]:
    """Infos of the environments in ``mask``, batched as Gymnasium batches them.

    Each key has a companion ``_key`` that says where it holds; elsewhere stand zeros, which are
    written into ``values``.
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
    """Steps after which episodes are truncated; ``OptionError`` unless positive or -1."""
    if isinstance(steps, int) and steps == NO_STEP_LIMIT:
        return int(np.iinfo(np.int64).max)
    return check_count(steps, "max_episode_steps")
