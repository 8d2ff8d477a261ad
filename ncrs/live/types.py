"""Types of the values in translated functions: scalars, records, tuples and arrays."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from ncrs_envs.batched.dtypes import Record
from ncrs_envs.errors import NCRSError


class TranslationError(NCRSError, ValueError):
    """A construct that the translator does not know, with its place in the source."""


@dataclass(frozen=True)
class Scalar:
    """A number or a truth value."""

    name: str


FLOAT = Scalar("float")
FLOAT32 = Scalar("float32")
INT = Scalar("int")
BOOL = Scalar("bool")
NONE = Scalar("none")
NUMBERS = (FLOAT, FLOAT32, INT)


@dataclass(frozen=True)
class Struct:
    """A record: an object that holds the fields of its class."""

    kind: type[Record]

    def field(self, name: str) -> Type | None:
        """Return the type of a field, None if there is no such field."""
        fields: dict[str, Type] = record_fields(self.kind)  # type: ignore[arg-type]
        return fields.get(name)  # the class is hashable, which mypy doubts


@dataclass(frozen=True)
class Tuple:
    """A tuple; one of a named class is an object with its fields, any other an array."""

    items: tuple[Type, ...]
    kind: type[Any] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the fields; none for a plain tuple."""
        return () if self.kind is None else tuple(self.kind._fields)

    def field(self, name: str) -> Type | None:
        """Return the type of a field, None if there is no such field."""
        return dict(zip(self.names, self.items, strict=True)).get(name) if self.kind else None


@dataclass(frozen=True)
class Array:
    """An array of ``rank`` axes: of records, or of the numbers of a numpy dtype."""

    item: Struct | str
    rank: int = 1

    @property
    def element(self) -> Type:
        """Type of one element, as it is read."""
        return self.item if isinstance(self.item, Struct) else _ELEMENTS[self.item]


Type = Union[Scalar, Struct, Tuple, Array]  # noqa: UP007 - the classes name each other

_ELEMENTS: dict[str, Type] = {
    "float32": FLOAT32,
    "float64": FLOAT,
    "int8": INT,
    "int64": INT,
    "bool": BOOL,
}
STORES = {
    "float32": "Float32Array",
    "float64": "Float64Array",
    "int8": "Int8Array",
    # Indices and keys, all far below 2**31.
    "int64": "Int32Array",
    "bool": "Uint8Array",
}
"""JavaScript's typed array for each dtype."""


@cache
def record_fields(kind: type[Record]) -> dict[str, Type]:
    """Return the types of a record's fields, in order."""
    hints = get_type_hints(kind, include_extras=True)
    return {name: from_annotation(hint) for name, hint in hints.items()}


def array_shape(kind: type[Record], name: str) -> tuple[int, ...]:
    """Return the fixed shape of a record's field that is an array."""
    _, shape = get_args(get_type_hints(kind, include_extras=True)[name])
    return shape if isinstance(shape, tuple) else (shape,)


def from_annotation(hint: Any, rank: int = 1) -> Type:
    """Return the type that an annotation declares.

    Args:
        hint: Annotation, resolved.
        rank: Number of axes of an array, which annotations of the kernels do not tell.

    Raises:
        TranslationError: If the annotation declares something else.
    """
    if get_origin(hint) is Annotated:
        array, shape = get_args(hint)
        return from_annotation(array, len(shape) if isinstance(shape, tuple) else 1)
    if hint in _SCALARS:
        return _SCALARS[hint]
    if isinstance(hint, type) and issubclass(hint, Record):
        return Struct(hint)
    if isinstance(hint, type) and issubclass(hint, tuple) and hasattr(hint, "_fields"):
        hints = get_type_hints(hint, include_extras=True)
        return Tuple(tuple(from_annotation(hints[name]) for name in hint._fields), hint)
    if get_origin(hint) is tuple:
        return Tuple(tuple(from_annotation(item) for item in get_args(hint)))
    if get_origin(hint) is np.ndarray:
        return Array(_item(hint), rank)
    raise TranslationError(f"The annotation {hint!r} is none that the translator knows.")


_SCALARS: dict[Any, Type] = {float: FLOAT, int: INT, bool: BOOL, type(None): NONE}


def _item(hint: Any) -> Struct | str:
    """Return the item of an annotated array; arrays of any floats hold those of the automaton."""
    (item,) = get_args(get_args(hint)[1])
    if issubclass(item, Record):
        return Struct(item)
    return "float32" if item is np.floating else dtype_name(np.dtype(item))


def dtype_name(dtype: np.dtype[Any]) -> str:
    """Return the name of a dtype that arrays may have; raise ``TranslationError`` for others."""
    if dtype.name not in STORES:
        raise TranslationError(f"Arrays of {dtype.name} are none that the translator knows.")
    return dtype.name


def constant_type(value: Any) -> Type | None:
    """Return the type of a constant of a module, None if it cannot be one."""
    if isinstance(value, bool | np.bool_):
        return BOOL
    if isinstance(value, np.float32):
        return FLOAT32
    if isinstance(value, int | np.integer):
        return INT
    if isinstance(value, float | np.floating):
        return FLOAT
    if isinstance(value, np.ndarray) and value.ndim == 1:
        return Array(dtype_name(value.dtype))
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        items = [constant_type(item) for item in value]
        if None not in items:
            return Tuple(tuple(items), type(value))  # type: ignore[arg-type] # None is not in it
    return None


def joined(first: Type, second: Type) -> Type | None:
    """Return the type of a value of either type, None if there is none."""
    if first == second:
        return first
    if {first, second} <= {FLOAT, INT}:
        return FLOAT
    return None
