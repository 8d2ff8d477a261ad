"""How the batched simulator's kernels are compiled: one set of numba options for all of them.

The options keep results bit-identical on any number of threads: no ``fastmath``, so that nothing
is reassociated. ``error_model="numpy"`` leaves no exceptions in the kernels.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast


class NumbaMissingError(ImportError):
    """The batched simulator was asked for, but numba is not installed."""


try:
    import numba
except ImportError as error:
    raise NumbaMissingError(
        "The batched simulator needs numba, which is not installed: pip install numba. "
        "Without it, use gymnasium.make_vec(..., vectorization_mode='sync'), which runs on Box2D."
    ) from error

Function = TypeVar("Function", bound=Callable[..., Any])

prange = numba.prange


def kernel(function: Function) -> Function:
    """Compile a function of scalars and arrays at its first call, and keep it on disk."""
    compiled = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    return cast(Function, compiled)


def parallel_kernel(function: Function) -> Function:
    """As ``kernel``, with ``prange`` loops spread over threads."""
    compiled = numba.njit(cache=True, nogil=True, error_model="numpy", parallel=True)(function)
    return cast(Function, compiled)
