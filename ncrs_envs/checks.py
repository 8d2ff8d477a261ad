"""Checks shared by records of settings."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Sequence
from dataclasses import fields, is_dataclass
from numbers import Integral, Real
from types import NoneType
from typing import Any, get_args, get_origin, get_type_hints

from ncrs_envs.errors import NCRSError

_KINDS = {bool: "true or false", int: "an integer", float: "a number", str: "a string"}


def check_types(record: Any, error: type[NCRSError]) -> None:
    """Check that each field of a dataclass has the type of its annotation.

    Numbers become plain Python numbers, which JSON can hold.

    Args:
        record: Record whose fields are booleans, integers, numbers, strings, other records, lists
            of one of these, or any of these or None.
        error: Class of the error to raise; its message names the field and the value.
    """
    hints = get_type_hints(type(record))
    for item in fields(record):
        value, hint = getattr(record, item.name), hints[item.name]
        kinds = get_args(hint) or (hint,)
        if value is None and NoneType in kinds:
            continue
        kind = kinds[0]
        if not _is_of(value, kind):
            raise error(f"{item.name} must be {_expected(kind)}, got {value!r}.")
        if kind in (int, float):
            setattr(record, item.name, _plain(item.name, value, kind, error))
        elif get_origin(kind) is list:
            setattr(record, item.name, list(value))


def _expected(kind: Any) -> str:
    if get_origin(kind) is list:
        return f"a list of {_expected(get_args(kind)[0]).split()[-1]}s"
    return _KINDS.get(kind) or f"one of the {kind.__name__}"


def _plain(name: str, value: Any, kind: type, error: type[NCRSError]) -> Any:
    try:
        plain = kind(value)
    except OverflowError:  # an integer beyond all floats
        plain = math.inf
    if kind is float and not math.isfinite(plain):
        raise error(f"{name} must be finite, got {value!r:.40}.")
    return plain


def _is_of(value: Any, kind: type) -> bool:
    if is_dataclass(kind) or kind in (bool, str):
        return isinstance(value, kind)
    if get_origin(kind) is list:
        (item,) = get_args(kind)
        # OmegaConf has sequences of its own.
        is_sequence = isinstance(value, Sequence) and not isinstance(value, str)
        return is_sequence and all(_is_of(each, item) for each in value)
    number = Integral if kind is int else Real
    return isinstance(value, number) and not isinstance(value, bool)


def closest(name: str, known: Iterable[str]) -> list[str]:
    """Find up to three known names similar to ``name``, the closest first."""
    return difflib.get_close_matches(name, list(known), n=3, cutoff=0.5)
