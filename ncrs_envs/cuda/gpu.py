"""What kernels on GPUs have in common: their decorators, memory, and launches, by numba-cuda."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
from numba import cuda
from numba.cuda.core import config
from numba.cuda.np.numpy_support import from_dtype
from numpy.typing import NDArray

from ncrs_envs.batched.dtypes import dtype_of
from ncrs_envs.batched.layout import Contact, Point

IS_SIMULATED = bool(config.ENABLE_CUDASIM)
"""True where kernels run in numba-cuda's simulator, without a GPU."""

# numba-cuda warns of every launch of few blocks, which small populations cannot avoid.
config.CUDA_LOW_OCCUPANCY_WARNINGS = 0

Function = TypeVar("Function", bound=Callable[..., Any])

WARP = 32
"""Number of threads in a warp."""
MAX_REGISTERS = 128
"""Maximum number of registers per thread: with more, too few warps are in flight."""


def gpu_kernel(function: Callable[..., None]) -> Any:
    """Make a function that ``Launcher`` starts on a GPU."""
    decorate = cuda.jit if IS_SIMULATED else cuda.jit(max_registers=MAX_REGISTERS)
    return decorate(function)


def device_function(function: Function) -> Function:
    """Make a function that kernels call, with threads, blocks and shared memory of its own."""
    return cast(Function, cuda.jit(device=True)(function))


def inlined_on_gpu(function: Function) -> Function:
    """Make a device function that is compiled into its callers.

    For functions that return tuples of records, which device functions cannot return.
    """
    return cast(Function, cuda.jit(device=True, inline="always")(function))


def reused(function: Function) -> Function:
    """Make a device function of one that numba compiles into its callers on the CPU."""
    return cast(Function, device_function(function.py_func))  # type: ignore[attr-defined]


CONTACT = dtype_of(Contact) if IS_SIMULATED else from_dtype(dtype_of(Contact))
"""Type of local arrays of contacts."""
POINT = dtype_of(Point) if IS_SIMULATED else from_dtype(dtype_of(Point))


def to_device(array: NDArray[Any]) -> Any:
    """Copy an array to the current GPU."""
    return array.copy() if IS_SIMULATED else cuda.to_device(np.ascontiguousarray(array))


def device_array(shape: tuple[int, ...], dtype: Any) -> Any:
    """Return a new array on the current GPU, with undefined values."""
    return np.zeros(shape, dtype) if IS_SIMULATED else cuda.device_array(shape, dtype)


def send(array: NDArray[Any], place: Any) -> Any:
    """Copy an array to the start of memory on the current GPU, and return that part of it."""
    view = place if place.shape == array.shape else place[: len(array)]
    if IS_SIMULATED:
        view[...] = array
    elif array.size:
        view.copy_to_device(np.ascontiguousarray(array))
    return view


def to_host(array: Any) -> NDArray[Any]:
    """Copy an array from its GPU, after all that was launched there before."""
    copy: NDArray[Any] = array.copy() if IS_SIMULATED else array.copy_to_host()
    return copy


def wait() -> None:
    """Wait for all that was started on the current GPU, on any stream."""
    if not IS_SIMULATED:
        cuda.synchronize()


def max_shared() -> int:
    """Return the float32 elements of shared memory that a block on the current GPU may use."""
    if IS_SIMULATED:
        return _SIMULATED_SHARED // 4
    return int(cuda.get_current_device().MAX_SHARED_MEMORY_PER_BLOCK_OPTIN) // 4


def free_memory() -> int:
    """Return the free memory of the current GPU, in bytes."""
    return _SIMULATED_MEMORY if IS_SIMULATED else int(cuda.current_context().get_memory_info().free)


def processors() -> int:
    """Return the number of multiprocessors of the current GPU."""
    return 1 if IS_SIMULATED else int(cuda.get_current_device().MULTIPROCESSOR_COUNT)


_SIMULATED_SHARED = 99 * 1024
_SIMULATED_MEMORY = 2**30
_DEFAULT_SHARED = 48 * 1024
"""Bytes of shared memory that every kernel may use."""


class Launcher:
    """A kernel for arguments of one kind, on one GPU.

    Args:
        kernel: Result of ``gpu_kernel``.
    """

    def __init__(self, kernel: Any) -> None:
        self.kernel_name: str = kernel.py_func.__name__
        self._kernel = kernel
        self._compiled: Any = None
        self._allowed = _DEFAULT_SHARED

    def __call__(
        self,
        grid: tuple[int, ...],
        threads: int,
        shared_floats: int,
        *arguments: Any,
        stream: Any = 0,
    ) -> None:
        """Start the kernel on the current GPU.

        Args:
            grid: Number of blocks along each axis.
            threads: Number of threads per block.
            shared_floats: Size of a block's shared memory, in float32 elements.
            *arguments: Arguments of the kernel, of the same types at every call.
            stream: Stream of numba-cuda that the kernel is started on; 0 for the default one.
        """
        if self._compiled is None:
            # Looking up the types of some twenty arrays at each call would take longer than growth.
            self._compiled = self._kernel.specialize(*arguments)
        size = 4 * shared_floats
        if size > self._allowed and not IS_SIMULATED:
            _allow_shared(self._compiled, size)
            self._allowed = size
        self._compiled[grid, threads, stream, size](*arguments)


def _allow_shared(compiled: Any, size: int) -> None:
    """Let a kernel use more shared memory than by default, as each kernel has to ask for."""
    from numba.cuda.cudadrv.driver import binding, driver

    (overload,) = compiled.overloads.values()
    function = overload._codelibrary.get_cufunc()
    name = binding.CUfunction_attribute.CU_FUNC_ATTRIBUTE_MAX_DYNAMIC_SHARED_SIZE_BYTES
    driver.cuKernelSetAttribute(name, size, function.handle, function.device.id)
