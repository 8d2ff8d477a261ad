"""Records: dtypes that follow from annotated classes."""

from __future__ import annotations

from typing import Annotated

import numba
import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.dtypes import Record, assign, column, dtype_of, records


class Inner(Record):
    flag: bool
    number: int


class Outer(Record):
    first: bool
    value: float
    matrix: Annotated[NDArray[np.float64], (2, 3)]
    items: Annotated[NDArray[Inner], 4]


@numba.njit
def _write(outer: Outer, index: int) -> int:
    outer.value = 2.5
    outer.matrix[1, index] = 4.0
    inner = outer.items[index]
    inner.number = 7
    inner.flag = True
    return inner.number


def test_fields_follow_from_the_annotations():
    dtype = dtype_of(Outer)
    assert dtype.names == ("first", "value", "matrix", "items")
    assert dtype["value"] == np.float64
    assert (dtype["matrix"].base, dtype["matrix"].shape) == (np.float64, (2, 3))
    assert (dtype["items"].base, dtype["items"].shape) == (dtype_of(Inner), (4,))
    assert dtype_of(Inner)["number"] == np.int64
    assert dtype_of(Inner)["flag"] == np.bool_


def test_fields_are_aligned():
    """A GPU reads fields that are not aligned byte by byte."""
    dtype = dtype_of(Outer)
    assert dtype.isalignedstruct
    offsets = [field[1] for field in dtype.fields.values()]
    assert offsets == [0, 8, 16, 64]
    assert dtype.itemsize == 64 + 4 * 16


def test_kernels_and_python_see_the_same_fields():
    array = records(Outer, 3)
    assert not array.tobytes().strip(b"\0")
    assert _write(array[1], 2) == 7
    outer = array[1]
    assert isinstance(outer, Outer)
    assert outer.value == 2.5
    assert outer.matrix.tolist() == [[0, 0, 0], [0, 0, 4.0]]
    assert outer.items[2].number == 7
    assert outer.items["flag"].tolist() == [False, False, True, False]
    assert column(array, "value").tolist() == [0.0, 2.5, 0.0]
    outer.value = 1.0
    assert array["value"].tolist() == [0.0, 1.0, 0.0]


def test_assign_copies_whole_records():
    source, target = records(Outer, 2, 3), records(Outer, 4, 5)
    column(source, "value")[:] = np.arange(6).reshape(2, 3)
    source[1, 2].items[3].number = 9
    assign(target, ([3, 1], slice(3)), source)
    assert column(target, "value")[[3, 1], :3].tolist() == [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]
    assert target[1, 2].items[3].number == 9
    assert not column(target, "value")[[0, 2]].any()
    assign(target, [0, 2], source[:1, :1])
    assert column(target, "value")[[0, 2]].tolist() == [[0.0] * 5] * 2
