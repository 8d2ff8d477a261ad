"""Records: numpy structured dtypes that follow from annotated classes.

A class derived from ``Record`` declares the fields of a structured dtype once::

    class Point(Record):
        x: float
        y: float

    class Quad(Record):
        corner_count: int
        corners: Annotated[NDArray[Point], 4]

``records(Quad, 10)`` is then an array of ten quads, whose items have the fields as attributes: in
Python, in kernels on the CPU and, since fields are aligned, in kernels on GPUs.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:

    class _Base(np.generic):  # numpy declares np.record as having every attribute
        def __new__(cls) -> _Base: ...

else:
    _Base = np.record

_SCALARS: dict[Any, type[np.generic]] = {float: np.float64, int: np.int64, bool: np.bool_}


class Record(_Base):
    """Base of the classes that declare records; instances are items of arrays of ``dtype_of``.

    Fields are ``float``, ``int``, ``bool`` or arrays of a fixed shape:
    ``Annotated[NDArray[kind], shape]``, where the kind is a numpy scalar or a record.
    """


RecordType = TypeVar("RecordType", bound=Record)


@cache
def dtype_of(kind: Any) -> np.dtype[Any]:
    """Return the structured dtype that a record class declares, aligned as in C."""
    hints = get_type_hints(kind, include_extras=True)
    fields: list[Any] = [(name, *_field(hint)) for name, hint in hints.items()]
    return np.dtype((kind, np.dtype(fields, align=True)))


def _field(hint: Any) -> tuple[Any, ...]:
    """Return the dtype of a field, and its shape if it is an array."""
    if get_origin(hint) is Annotated:
        array, shape = get_args(hint)
        arguments = get_args(array)
        # Before NumPy 2.5 NDArray[item] was ndarray[shape, dtype[item]], since then it is an alias.
        (item,) = arguments if len(arguments) == 1 else get_args(arguments[1])
        return (dtype_of(item) if issubclass(item, Record) else item, shape)
    return (_SCALARS[hint],)


def records(kind: type[RecordType], *shape: int) -> NDArray[RecordType]:
    """Return a new array of records whose fields are all 0."""
    dtype: np.dtype[RecordType] = dtype_of(kind)  # type: ignore[arg-type] # it is hashable
    return np.zeros(shape, dtype)


def column(array: NDArray[Any], field: str) -> NDArray[Any]:
    """Return one field of all records, as a view."""
    view: NDArray[Any] = array[field]
    return view


def assign(target: NDArray[RecordType], index: Any, source: NDArray[RecordType]) -> None:
    """Do ``target[index] = source`` byte by byte; numpy itself copies records field by field."""
    plain = f"V{target.dtype.itemsize}"
    target.view(plain)[index] = source.view(plain)
