"""Genomes in the weight order of the published code, whose automaton is a Keras model.

Keras stores a kernel as (row, column, input, output), torch as (output, input, row, column). All
else is the same, the number of weights too, so that a genome in the wrong order raises no error: it
grows another body, or none.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import GenomeError, NCALayout, nca_layout
from ncrs_envs.tasks import Task

_TO_TORCH = (3, 2, 0, 1)
"""Axes of a Keras kernel in torch's order."""
_TO_KERAS = (2, 3, 1, 0)
"""Axes of a torch kernel in Keras' order."""


def convert_keras_genome(weights: Any, task: str | Task) -> NDArray[np.float32]:
    """Convert weights of the published code's automaton to a genome.

    Args:
        weights: Finite real numbers: the flat vector that the published code searches, shape
            ``(num_parameters,)``, or P of them, shape ``(P, num_parameters)``; or the arrays of
            ``model.get_weights()``, kernel and bias of each layer in turn.
        task: Task or its name, "light_chase", "obstacle" or "carry_ball".

    Returns:
        The genome, float32 ``(num_parameters,)``, or the genomes, ``(P, num_parameters)``.

    Raises:
        GenomeError: The weights have the wrong shape or dtype, or values that are not finite.
        TaskError: The task is unknown.
    """
    layout = nca_layout(task)
    if _is_list_of_arrays(weights):
        weights = _flat(weights, layout)
    shapes = _keras_shapes(layout)
    ends = np.cumsum([int(np.prod(shape)) for shape in shapes])[:-1]
    split = np.split(layout.check_genomes(weights), ends, axis=1)
    layers = [part.reshape(-1, *shape) for part, shape in zip(split, shapes, strict=True)]
    return _joined([_reordered(layer, _TO_TORCH) for layer in layers], weights)


def convert_to_keras(genomes: Any, task: str | Task) -> NDArray[np.float32]:
    """Convert genomes to the weight order of the published code; inverse of the other converter.

    Args:
        genomes: Finite real numbers, shape ``(num_parameters,)`` or ``(P, num_parameters)``.
        task: Task or its name, "light_chase", "obstacle" or "carry_ball".

    Returns:
        The flat vectors that the published code searches, float32, same shape.

    Raises:
        GenomeError: The genomes have the wrong shape or dtype, or values that are not finite.
        TaskError: The task is unknown.
    """
    layout = nca_layout(task)
    layers = layout.layers(layout.check_genomes(genomes))
    return _joined([_reordered(layer, _TO_KERAS) for layer in layers], genomes)


def _reordered(layer: NDArray[np.float32], axes: Sequence[int]) -> NDArray[np.float32]:
    """Reorder the axes of kernels, ``(P, ...)``, and return biases as they are."""
    return layer if layer.ndim == 2 else layer.transpose(0, *(axis + 1 for axis in axes))


def _keras_shapes(layout: NCALayout) -> list[tuple[int, ...]]:
    """Return the shapes of kernel and bias of each layer in Keras."""
    return [
        tuple(shape[axis] for axis in _TO_KERAS) if len(shape) == len(_TO_KERAS) else shape
        for shape in layout.parameter_shapes
    ]


def _is_list_of_arrays(weights: Any) -> bool:
    return isinstance(weights, Sequence) and len(weights) > 0 and np.ndim(weights[0]) > 1


def _flat(arrays: Sequence[Any], layout: NCALayout) -> NDArray[Any]:
    """Join the arrays of a Keras model to one vector."""
    found, expected = [np.shape(array) for array in arrays], _keras_shapes(layout)
    if found != expected:
        raise GenomeError(
            f"The weights of a Keras model for {layout.task.name} must have the shapes {expected}, "
            f"got {found}."
        )
    return np.concatenate([np.ravel(array) for array in arrays])


def _joined(layers: Sequence[NDArray[np.float32]], given: Any) -> NDArray[np.float32]:
    """Join layers ``(P, ...)`` to vectors; to one alone if one alone was given."""
    rows = np.concatenate([layer.reshape(len(layer), -1) for layer in layers], axis=1)
    return rows[0] if np.ndim(given) == 1 else rows
