"""Operations that numba-cuda's simulator does not know: those of ``register_tiles``, a barrier.

The simulator runs each thread of a block as a thread of Python.
"""

from __future__ import annotations

import threading
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]


def _fused(a: Floats, b: Floats, c: Floats) -> Floats:
    """Compute ``a * b + c`` with one rounding: in float64 the product is exact."""
    wide = a.astype(np.float64) * b.astype(np.float64) + c.astype(np.float64)
    result: Floats = wide.astype(np.float32)
    return result


def repeat_row(rows: int, lanes: int, array: Floats, offset: int) -> Floats:
    """Return a tile whose rows are all ``array[offset : offset + lanes]``."""
    return np.repeat(array[None, offset : offset + lanes], rows, axis=0)


def add_outer_products(  # noqa: PLR0913 - the operands of one operation
    tile: Floats, count: int, stride: int, array: Floats, weights: int, inputs: int, apart: int
) -> Floats:
    """Return a tile to which ``count`` outer products are added, one after the other."""
    rows, lanes = tile.shape
    for index in range(count):
        first = weights + index * stride
        values = array[[inputs + row * apart + index for row in range(rows)]]
        tile = _fused(array[None, first : first + lanes], values[:, None], tile)
    return tile


def rectified(tile: Floats) -> Floats:
    """Return ``max(tile, 0)``; NaN stays NaN."""
    return np.where(tile < 0, np.float32(0.0), tile)


def add_units(  # noqa: PLR0913 - the operands of one operation
    change: Floats,
    hidden: Floats,
    group: int,
    stride: int,
    length: int,
    array: Floats,
    second: int,
    bias: int,
    third: int,
) -> Floats:
    """Return the change of the channels to which some units of the second layer are added."""
    sums = repeat_row(len(hidden), group, array, bias)
    for unit in range(hidden.shape[1]):
        start = second + unit * stride
        sums = _fused(array[None, start : start + group], hidden[:, unit, None], sums)
    sums = rectified(sums)
    for lane in range(group):
        start = third + lane * length
        weights = array[None, start : start + change.shape[1]]
        change = _fused(weights, sums[:, lane, None], change)
    return change


def store_clipped_sum(  # noqa: PLR0913 - the operands of one operation
    tile: Floats, limit: np.float32, array: Floats, inputs: int, outputs: int, apart: int
) -> None:
    """Write ``clip(array[inputs + ...] + tile, -limit, limit)`` from ``outputs`` on."""
    rows, lanes = tile.shape
    for row in range(rows):
        source, target = inputs + row * apart, outputs + row * apart
        total = array[source : source + lanes] + tile[row]
        array[target : target + lanes] = np.clip(total, -limit, limit)


_WARP = 32
_PATIENCE_S = 60.0
_barriers: WeakKeyDictionary[Any, dict[int, threading.Barrier]] = WeakKeyDictionary()
_lock = threading.Lock()


def sync_warp() -> None:
    """Wait for the other threads of the warp."""
    thread: Any = threading.current_thread()
    with _lock:
        of_block = _barriers.setdefault(thread._manager, {})
        barrier = of_block.setdefault(thread.thread_id // _WARP, threading.Barrier(_WARP))
    barrier.wait(_PATIENCE_S)
