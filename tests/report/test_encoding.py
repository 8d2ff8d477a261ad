"""Packing and rounding of arrays."""

import base64

import numpy as np
import pytest

from ncrs.report.encoding import pack, quantize


def test_pack_is_little_endian_in_c_order():
    values = np.arange(6, dtype=np.int16).reshape(2, 3)
    expected = bytes([0, 0, 3, 0, 1, 0, 4, 0, 2, 0, 5, 0])
    assert base64.b64decode(pack(values.T)) == expected
    assert base64.b64decode(pack(values.astype(">i2").T)) == expected


@pytest.mark.parametrize(
    ("dtype", "limit", "values", "expected"),
    [
        (np.int8, 5.0, [-5.0, 0.0, 5.0, 9.0, -9.0], [-127, 0, 127, 127, -127]),
        (np.uint8, 1.0, [0.0, 0.5, 1.0, 1.1, -0.1], [0, 128, 255, 255, 0]),
        (np.int16, 100.0, [-100.0, 50.0], [-32767, 16384]),
    ],
)
def test_quantize(dtype, limit, values, expected):
    rounded = quantize(np.array(values), limit, dtype)
    assert rounded.dtype == dtype
    assert rounded.tolist() == expected


def test_rounding_error_is_half_a_step():
    values = np.linspace(-5.0, 5.0, 1001)
    shown = quantize(values, 5.0, np.int8) * (5.0 / 127)
    assert np.abs(shown - values).max() <= 0.5 * 5.0 / 127 + 1e-12


def test_values_that_are_not_finite_are_refused():
    with pytest.raises(ValueError, match="2 values that are not finite"):
        quantize(np.array([0.0, np.nan, np.inf]), 1.0, np.int8)
