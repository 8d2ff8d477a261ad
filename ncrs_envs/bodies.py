"""Reading of one body for all, or of a body for each environment or genome."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.body import DEFAULT_GRID_SIZE, BodyError, is_whole_body, parse_body
from ncrs_envs.interface import from_tensor
from ncrs_envs.tasks import Task


def check_bodies(
    body: Any, task: Task, grid_size: int, mask: NDArray[np.bool_], owner: str = "environment"
) -> NDArray[np.int8]:
    """Return the bodies of the owners in ``mask``.

    Args:
        body: One body in any form that ``parse_body`` takes, or a body for each owner: an integer
            array of shape ``(count, n, n)``, or a sequence of bodies in any form.
        task: Task that must be able to use the bodies.
        grid_size: Required side of the bodies.
        mask: Mask of the owners, shape ``(count,)``; bodies of the others are not checked.
        owner: Word for what has a body, for messages.

    Returns:
        int8 ``(1, n, n)`` if there is one body for all, else ``(selected, n, n)``.

    Raises:
        BodyError: A body is malformed, or the task cannot use it; names the owner.
    """
    body = from_tensor(body)
    if not _is_one_for_each(body):
        grid = parse_body(body, grid_size)
        task.check_body(grid)
        return grid[None]
    if len(body) != len(mask):
        raise BodyError(
            f"body must hold one body for each of {len(mask)} {owner}s, or be a single one, "
            f"got {len(body)}."
        )
    bodies = _stacked(body, grid_size, mask, owner)
    chosen = bodies[mask]
    # Codes beyond int8 would wrap around to known ones.
    fits = ((chosen >= 0) & (chosen <= np.iinfo(np.int8).max)).all(axis=(1, 2))
    usable = fits & task.is_valid(chosen)
    if not usable.all():
        first = int(np.flatnonzero(mask)[np.argmin(usable)])
        with _of(owner, first):
            task.check_body(parse_body(bodies[first], grid_size))
    return np.asarray(chosen, dtype=np.int8)


def _is_one_for_each(body: Any) -> bool:
    """Tell a body for each owner from one body for all; the first item decides."""
    if isinstance(body, np.ndarray) and body.dtype.kind != "U":
        return body.ndim == 3
    if isinstance(body, str) or not isinstance(body, np.ndarray | Sequence) or not len(body):
        return False
    first = body[0]
    if isinstance(first, str):
        return is_whole_body(first)
    if not isinstance(first, np.ndarray | Sequence) or not len(first):
        return False
    row = first[0]
    # A string of one character is no row, but a cell.
    return len(row) > 1 if isinstance(row, str) else isinstance(row, np.ndarray | Sequence)


def _stacked(bodies: Any, grid_size: int, mask: NDArray[np.bool_], owner: str) -> NDArray[Any]:
    """Return a body for each owner as one integer array; those not in ``mask`` may be 0."""
    try:
        stacked = np.asarray(bodies)
    except ValueError:  # of different sizes
        stacked = np.empty(0)
    if stacked.shape[1:] == (grid_size, grid_size) and stacked.dtype.kind in "iu":
        return stacked
    parsed = np.zeros((len(bodies), grid_size, grid_size), dtype=np.int8)
    for index in np.flatnonzero(mask).tolist():
        with _of(owner, index):
            parsed[index] = parse_body(bodies[index], grid_size)
    return parsed


@contextmanager
def _of(owner: str, index: int) -> Iterator[None]:
    """Name the owner in errors about its body."""
    try:
        yield
    except BodyError as error:
        raise BodyError(f"{owner.capitalize()} {index}: {error}") from error


def grid_side(body: Any) -> int:
    """Return the side of the grid of a body, or of an array of bodies."""
    if body is None:
        return DEFAULT_GRID_SIZE
    body = from_tensor(body)
    if _is_one_for_each(body):
        body = body[0]
    return int(parse_body(body).shape[0])
