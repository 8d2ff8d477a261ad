"""The arithmetic of the learning aids, for one environment or many: leading axes are free."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.body import SENSOR_CELLS, sensor_mask, wheel_mask
from ncrs_envs.errors import NCRSError

CONTRAST = 30.0
"""Sensors of one robot differ by about 0.03: this makes differences of order one."""
CHANGE = 50.0
"""A sensor value changes by about 0.02 in a step: this makes changes of order one."""
PROGRESS = 50.0
"""The reward changes by about 0.02 in a step."""


class ViewError(NCRSError, ValueError):
    """A wrapper around an environment that does not offer what the wrapper needs."""


def require_vectors(space: Any, wrapper: str, count: int, parts: str) -> None:
    """Check that a space holds one value per part, as behind ``FixedBodyView``.

    Raises:
        ViewError: it does not.
    """
    if getattr(space, "shape", None) != (count,):
        raise ViewError(
            f"{wrapper} needs one value per {parts}, shape ({count},), got {space}; wrap the "
            "environment in FixedBodyView first."
        )


class SensorContrast:
    """Differences between a body's sensors, and changes over a step, at a learnable scale.

    What tells left from right is a difference of about 0.03 between values that all rise and fall
    together; on the raw values a policy learns nothing but their common level.

    Args:
        bodies: cell codes of the whole bodies, ``(n, n)``, or ``(N, n, n)`` with equally many
            sensors each.
        contrast: factor of the differences.
        change: factor of the changes.
    """

    def __init__(self, bodies: NDArray[np.int8], contrast: float, change: float) -> None:
        self._mask = mask = sensor_mask(bodies)
        sensors = int(mask.reshape(-1, mask.shape[-1] ** 2).sum(axis=1)[0])
        codes = bodies[mask].reshape(*bodies.shape[:-2], sensors)
        kinds = [int(cell) for cell in SENSOR_CELLS if (codes == int(cell)).any()]
        self._belongs = (codes[..., None] == np.array(kinds)).astype(np.float32)
        self._contrast, self._change = np.float32(contrast), np.float32(change)
        self.size = 2 * sensors + len(kinds)
        """Length of the result: a difference and a change for each sensor, a mean for each kind."""

    def __call__(
        self,
        values: NDArray[np.float32],
        previous: NDArray[np.float32],
        bodies: NDArray[np.int8],
    ) -> NDArray[np.float32]:
        """Differences from the mean of each kind, those means, and changes, ``(..., size)``.

        Lost sensors have no part in the means; their own differences and changes are 0.

        Args:
            values: sensor values, ``(..., sensors)``.
            previous: those of the step before; the same at the start of an episode.
            bodies: present bodies, shaped as the whole ones.
        """
        present = sensor_mask(bodies)[self._mask].reshape(values.shape)
        belongs = self._belongs * present[..., None]
        weights = belongs / np.maximum(belongs.sum(axis=-2, keepdims=True), 1.0)
        means = np.einsum("...s,...sk->...k", values, weights)
        own = np.einsum("...k,...sk->...s", means, belongs)
        differences = self._contrast * present * (values - own)
        changes = self._change * present * (values - previous)
        return np.concatenate([differences, means, changes], axis=-1, dtype=np.float32)


def sides(bodies: NDArray[np.int8]) -> NDArray[np.float32]:
    """Contribution of the left and the right gas to each wheel, ``(..., wheels, 2)``.

    Wheels left of the middle column take the left gas, those right of it the right one, and those
    in the middle the mean of both.

    Args:
        bodies: cell codes, ``(..., n, n)`` with equally many wheels each.
    """
    n = bodies.shape[-1]
    columns = np.broadcast_to(np.arange(n), bodies.shape)
    mask = wheel_mask(bodies)
    wheels = int(mask.reshape(-1, n * n).sum(axis=1)[0])
    places = columns[mask].reshape(*bodies.shape[:-2], wheels) - 0.5 * (n - 1)
    left = 0.5 - 0.5 * np.sign(places)
    return np.stack([left, 1.0 - left], axis=-1).astype(np.float32)
