"""Arrays as text that scripts can read: little-endian, base64, most of them rounded to integers."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

RECEIVER = "NCRSReport.receive"
"""Name of the page's function that data files hand their content to."""


def pack(array: NDArray[Any]) -> str:
    """Encode an array's values in C order, little-endian, as base64."""
    little = array.astype(array.dtype.newbyteorder("<"), copy=False)
    return base64.b64encode(np.ascontiguousarray(little).tobytes()).decode("ascii")


def quantize(values: NDArray[np.floating], limit: float, dtype: DTypeLike) -> NDArray[Any]:
    """Round values from -limit to limit (0 to limit if unsigned) to the integers of ``dtype``.

    Values beyond the limit become the limit. The page multiplies by ``limit / maximum integer``.

    Raises:
        ValueError: If a value is not finite.
    """
    if not np.isfinite(values).all():
        raise ValueError(
            f"Cannot record {np.count_nonzero(~np.isfinite(values))} values that are not finite."
        )
    high = np.iinfo(dtype).max
    low = 0 if np.issubdtype(dtype, np.unsignedinteger) else -high
    rounded: NDArray[Any] = np.clip(np.rint(values * (high / limit)), low, high)
    return rounded.astype(dtype)


def write_data(path: Path, kind: str, index: int, value: Any) -> int:
    """Write a script that hands ``value`` to the page; returns its size in bytes.

    Pages opened from disk may load scripts, but not read other files.
    """
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return path.write_text(f"{RECEIVER}({json.dumps(kind)},{index},{text});\n", encoding="ascii")
