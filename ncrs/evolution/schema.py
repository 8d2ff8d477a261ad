"""Checks of stored states: every member by name, kind, shape and finiteness, before any is used."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from ncrs_envs.errors import NCRSError


class StoredStateError(NCRSError, ValueError):
    """A stored state that lacks a member, has a foreign one, or one that is malformed."""


def check_names(state: Any, needed: Collection[str], path: str, allowed: Collection[str]) -> None:
    """Check the names of a state's members.

    Args:
        state: Stored state.
        needed: Names that it must have.
        path: Name of the state, for the message.
        allowed: Further names that it may have.

    Raises:
        StoredStateError: If it is no mapping, lacks a name, or has another one.
    """
    if not isinstance(state, Mapping):
        raise StoredStateError(f"{path} must be a mapping, got {type(state).__name__}.")
    missing = sorted(set(needed) - set(state))
    if missing:
        raise StoredStateError(
            f"{path} lacks {', '.join(missing)}: it is incomplete, or another version wrote it."
        )
    foreign = sorted(set(state) - set(needed) - set(allowed))
    if foreign:
        raise StoredStateError(
            f"{path} has {', '.join(foreign)}, which this version does not know; use the version "
            "that wrote it."
        )


def check_like(value: Any, reference: Any, path: str, *, may_be_infinite: bool = False) -> None:
    """Check that a value is of the kind of a reference, and finite.

    Args:
        value: Stored value.
        reference: Array of the same dtype and shape, number, text or list; None for any of these.
        path: Name of the value, for the message.
        may_be_infinite: Allow infinity; never NaN.

    Raises:
        StoredStateError: If it differs in kind, dtype or shape, or is not finite.
    """
    if isinstance(reference, np.ndarray):
        if not isinstance(value, np.ndarray):
            raise StoredStateError(f"{path} must be an array, got {type(value).__name__}.")
        if (value.dtype, value.shape) != (reference.dtype, reference.shape):
            raise StoredStateError(
                f"{path} must be {reference.dtype} of shape {reference.shape}, got {value.dtype} "
                f"of shape {value.shape}."
            )
    elif reference is not None and _kind(value) != _kind(reference):
        raise StoredStateError(f"{path} must be {_kind(reference)}, got {value!r:.80}.")
    _check_finite(value, path, may_be_infinite)


def _kind(value: Any) -> str:
    if isinstance(value, bool):
        return "true or false"
    if isinstance(value, int | float):
        return "a number"
    if isinstance(value, list | tuple):
        return "a list"
    return type(value).__name__


def _check_finite(value: Any, path: str, may_be_infinite: bool) -> None:
    if isinstance(value, list | tuple):
        for item in value:
            _check_finite(item, path, may_be_infinite)
        return
    if isinstance(value, bool | str) or value is None:
        return
    array = np.asarray(value)
    if array.dtype.kind not in "fiub":
        raise StoredStateError(f"{path} must hold numbers, got {value!r:.80}.")
    if np.isnan(array).any() or (not may_be_infinite and np.isinf(array).any()):
        raise StoredStateError(f"{path} has values that are not finite.")
