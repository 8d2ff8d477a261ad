"""Frames of the vector environments, and the paths that they show."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.interface import OptionError
from ncrs_envs.rendering import (
    DEFAULT_RENDER_SIZE,
    MAX_RENDER_SIZE,
    MIN_RENDER_SIZE,
    Scene,
    check_render_size,
    draw_scene,
)

_SIZE_STEP = 16
"""Default sizes are multiples of this, as video encoders want."""


def check_render_envs(envs: Sequence[int] | None, count: int) -> tuple[int, ...]:
    """Return the indices of the environments to draw, each once; all of them for None.

    Raises:
        OptionError: An index is out of range.
    """
    if envs is None:
        return tuple(range(count))
    indices = [int(env) for env in envs]
    if any(not 0 <= env < count for env in indices):
        raise OptionError(f"render_envs must hold indices from 0 to {count - 1}, got {indices}.")
    return tuple(dict.fromkeys(indices))


def frame_size(size: Any, count: int) -> int:
    """Return the side of a frame in pixels.

    Args:
        size: Side that the user gave. By default, for None, ``count`` frames have together at most
            the pixels of the largest picture, unless each would be below the smallest.
        count: Number of environments.

    Raises:
        RenderError: ``size`` is out of range.
    """
    if size is not None:
        return check_render_size(size)
    side = int(MAX_RENDER_SIZE / count**0.5) // _SIZE_STEP * _SIZE_STEP
    return min(max(side, MIN_RENDER_SIZE), DEFAULT_RENDER_SIZE)


class Pictures:
    """Frames of ``count`` environments, and the paths of those that are drawn.

    Args:
        envs: Indices of the environments that are drawn.
        count: Number of environments.
        size: Side of a frame in pixels.
    """

    def __init__(self, envs: Iterable[int], count: int, size: int) -> None:
        self._paths: dict[int, list[tuple[float, float]]] = {env: [] for env in envs}
        self._count = count
        self._size = size

    def start(self, envs: Iterable[int], position: Callable[[int], tuple[float, float]]) -> None:
        """Begin new paths for environments.

        Args:
            envs: Indices of the environments.
            position: Function that gives the start of an environment's robot.
        """
        for env in envs:
            if env in self._paths:
                self._paths[env] = [position(env)]

    def extend(self, poses: NDArray[np.float64], has_moved: NDArray[np.bool_]) -> None:
        """Append the positions in ``poses``, ``(count, 3)``, of the environments that moved."""
        for env, path in self._paths.items():
            if has_moved[env]:
                path.append((float(poses[env, 0]), float(poses[env, 1])))

    def path(self, env: int) -> list[tuple[float, float]]:
        """Return the path of an environment so far; empty if it is not drawn."""
        return self._paths.get(env, [])

    def frames(self, scene: Callable[[int], Scene]) -> tuple[NDArray[np.uint8], ...]:
        """Draw a frame for each environment; those that are not drawn share a black one.

        Args:
            scene: Function that gives the scene of an environment.
        """
        black = np.zeros((self._size, self._size, 3), dtype=np.uint8)
        black.setflags(write=False)
        frames = [black] * self._count
        for env in self._paths:
            frames[env] = draw_scene(scene(env), self._size)
        return tuple(frames)
