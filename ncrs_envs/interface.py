"""Checks of reset options and actions, the same for every environment of the suite."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.errors import NCRSError
from ncrs_envs.perturbations import Damage, PerturbationError

RESET_OPTIONS = ("body", "region", "scenario", "damage")


class OptionError(NCRSError, ValueError):
    """An unknown or malformed option, or options that exclude each other."""


class ActionError(NCRSError, ValueError):
    """An action of the wrong shape, or with values that are not finite numbers."""


def check_options(options: Any) -> Mapping[str, Any]:
    """Return the options of ``reset`` as a mapping, empty for None.

    Raises:
        OptionError: ``options`` is not a mapping, has an unknown name, or both a region and a
            scenario.
    """
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        raise OptionError(
            f"options must be a dict with keys from {list(RESET_OPTIONS)}, "
            f"got {type(options).__name__}."
        )
    unknown = sorted(str(name) for name in set(options) - set(RESET_OPTIONS))
    if unknown:
        raise OptionError(f"Unknown reset options {unknown}; known are {list(RESET_OPTIONS)}.")
    if options.get("region") is not None and options.get("scenario") is not None:
        raise OptionError(
            "Give either region or scenario: a scenario already fixes all placements."
        )
    return options


def check_damage(damage: Any, grid_size: int) -> Damage:
    """Return the damage, or raise ``PerturbationError`` if it is none, or outside the grid."""
    if not isinstance(damage, Damage):
        raise PerturbationError(f"damage must be an ncrs_envs.Damage, got {type(damage).__name__}.")
    damage.check(grid_size)
    return damage


def check_flag(value: Any, name: str) -> bool:
    """Return ``value`` as a bool, or raise ``OptionError`` if it is not one."""
    if not isinstance(value, bool | np.bool_):
        raise OptionError(f"{name} must be True or False, got {value!r}.")
    return bool(value)


def from_tensor(value: Any) -> Any:
    """Return a tensor of torch, wherever it is, as a numpy array, and anything else as it is."""
    if callable(getattr(value, "detach", None)):
        return value.detach().cpu().numpy()
    return value


def check_action(action: Any, shape: tuple[int, ...], meaning: str) -> NDArray[np.float32]:
    """Return an action as a new float32 array, clipped to the range of float32.

    Args:
        action: Array or nested lists of real numbers.
        shape: Required shape of the action.
        meaning: Description of one value in error messages.

    Raises:
        ActionError: The action does not hold real numbers, has another shape, or has values that
            are not finite.
    """
    try:
        raw = np.asarray(from_tensor(action))
    except ValueError as error:
        raise ActionError(
            f"action must be an array of shape {shape}; its rows differ in length ({error})."
        ) from error
    except TypeError as error:  # such as a kind of number that only torch has
        raise ActionError(f"action must be an array of real numbers ({error}).") from error
    if raw.dtype.kind not in "fiub":
        raise ActionError(f"action must hold real numbers, got dtype {raw.dtype}.")
    if raw.shape != shape:
        raise ActionError(f"action must have shape {shape}, {meaning}, got {raw.shape}.")
    if raw.dtype == np.float32 and math.isfinite(np.vdot(raw, raw)):  # so is every value
        return raw.copy()
    if not np.isfinite(raw).all():
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(raw))[0])
        raise ActionError(f"action must be finite, got {raw[index]} at index {index}.")
    limit = float(np.finfo(np.float32).max)
    return np.asarray(np.clip(raw, -limit, limit), dtype=np.float32)
