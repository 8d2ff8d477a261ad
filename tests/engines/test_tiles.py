"""Tiles against the same arithmetic in numpy."""

from __future__ import annotations

import numpy as np
import pytest

numba = pytest.importorskip("numba")

from ncrs.engines.tiles import (  # noqa: E402
    add_outer_product,
    repeat_row,
    store_clipped_sum,
    store_rectified,
)

ROWS, LANES = 3, 8


@numba.njit
def _rectified_product(bias, weights, inputs, depth, out):
    tile = repeat_row(ROWS, LANES, bias, 0)
    for k in range(depth):
        tile = add_outer_product(tile, weights, k * LANES, inputs, k, depth)
    store_rectified(tile, out, 0, LANES)


@numba.njit
def _clipped_sum(change, limit, inputs, out):
    store_clipped_sum(repeat_row(ROWS, LANES, change, 0), limit, inputs, out, 0, LANES)


def _product(bias, weights, inputs):
    out = np.full((ROWS, LANES), 7.0, dtype=np.float32)
    _rectified_product(bias, weights.ravel(), inputs.ravel(), inputs.shape[1], out.reshape(-1))
    return out


def test_product_equals_numpy():
    rng = np.random.default_rng(0)
    bias, weights, inputs = (
        rng.standard_normal(shape).astype(np.float32) for shape in (LANES, (5, LANES), (ROWS, 5))
    )
    expected = np.maximum(bias + inputs.astype(np.float64) @ weights, 0.0)
    assert 0 < np.count_nonzero(expected) < expected.size
    np.testing.assert_allclose(_product(bias, weights, inputs), expected, atol=1e-6)


def test_a_row_does_not_depend_on_the_other_rows():
    rng = np.random.default_rng(1)
    bias, weights = (rng.random(s).astype(np.float32) for s in (LANES, (9, LANES)))
    inputs = rng.random((ROWS, 9)).astype(np.float32)
    rolled = np.roll(inputs, 1, axis=0)
    expected = np.roll(_product(bias, weights, inputs), 1, axis=0)
    np.testing.assert_array_equal(_product(bias, weights, rolled), expected)


def test_nan_passes_through_the_rectifier_in_its_row_alone():
    inputs = np.ones((ROWS, 2), dtype=np.float32)
    inputs[1, 0] = np.nan
    out = _product(np.zeros(LANES, dtype=np.float32), np.ones((2, LANES), dtype=np.float32), inputs)
    assert np.isnan(out[1]).all()
    np.testing.assert_array_equal(out[[0, 2]], 2.0)


def test_clipped_sum_limits_both_sides_and_keeps_nan():
    change = np.array([0, 1, 4, -4, 9, -9, np.nan, np.inf], dtype=np.float32)
    inputs = np.tile(np.float32([1, 1, 1, -1, 1, 1, 1, 1]), (ROWS, 1))
    out = np.zeros((ROWS, LANES), dtype=np.float32)
    _clipped_sum(change, np.float32(4.5), inputs.reshape(-1), out.reshape(-1))
    expected = [1, 2, 4.5, -4.5, 4.5, -4.5, np.nan, 4.5]
    np.testing.assert_array_equal(out, np.tile(np.float32(expected), (ROWS, 1)))
