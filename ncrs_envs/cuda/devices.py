"""GPUs: which can be used, and one sentence about each that cannot."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba import cuda

from ncrs_envs.cuda.gpu import IS_SIMULATED
from ncrs_envs.errors import NCRSError

MIN_CAPABILITY = (8, 0)
"""The first compute capability with all the instructions in use (NVIDIA Ampere, 2020)."""


_ERRORS = ("CudaAPIError", "CUDAError", "AcceleratorError", "OutOfMemoryError")
"""Names of the errors in which numba-cuda, cuda.core and torch report a GPU's failures."""


class UnusableGPUError(NCRSError, ValueError):
    """A GPU that is not there, too old, or taken."""


class FailedGPUError(NCRSError, RuntimeError):
    """A GPU whose memory was used up, or that failed."""


def check_device(index: int) -> None:
    """Raise ``UnusableGPUError`` unless the GPU with this index can be used."""
    if IS_SIMULATED:
        return
    if not cuda.is_available():
        raise UnusableGPUError(
            f"No NVIDIA GPU can be used here ({_reason()}): its driver may be missing."
        )
    count = len(cuda.gpus)
    if index >= count:
        raise UnusableGPUError(
            f"There is no GPU {index}: this machine has {count}, numbered from 0."
        )
    with on_device(index):
        gpu = cuda.get_current_device()
        capability = tuple(gpu.compute_capability)[:2]
    if capability < MIN_CAPABILITY:
        raise UnusableGPUError(
            f"GPU {index} ({_name(gpu)}) has compute capability {capability[0]}.{capability[1]}; "
            f"at least {MIN_CAPABILITY[0]}.{MIN_CAPABILITY[1]} is needed."
        )


def _is_of_gpu(error: Exception) -> bool:
    """Return True for an error of a GPU, by name: it may come from a package not imported here."""
    return type(error).__name__ in _ERRORS


def _reason() -> str:
    lines = str(cuda.cuda_error() or "").strip().splitlines()
    return lines[0].rstrip(".") if lines else "no driver was found"


def device_name(index: int) -> str:
    """Return the name of a GPU that can be used."""
    return "simulator" if IS_SIMULATED else _name(cuda.gpus[index])


def _name(gpu: Any) -> str:
    return gpu.name.decode() if isinstance(gpu.name, bytes) else str(gpu.name)


@contextmanager
def on_device(index: int) -> Iterator[None]:
    """Make a GPU the current one of this thread.

    Raises:
        UnusableGPUError: The GPU cannot be used now, such as while another process has it alone.
        FailedGPUError: Its memory was used up, or a kernel failed.
    """
    if IS_SIMULATED:
        yield
        return
    try:
        context = cuda.gpus[index]
        context.__enter__()
    except Exception as error:
        if not _is_of_gpu(error):
            raise
        raise UnusableGPUError(
            f"GPU {index} cannot be used now ({error}): another process may have it to itself."
        ) from error
    try:
        yield
    except Exception as error:
        if not _is_of_gpu(error):
            raise
        if "outofmemory" in f"{type(error).__name__}{error}".replace("_", "").lower():
            raise FailedGPUError(
                f"GPU {index} has too little free memory ({error}): end other processes on it, or "
                "simulate fewer episodes at once."
            ) from error
        raise FailedGPUError(f"GPU {index} failed ({error}).") from error
    finally:
        context.__exit__(None, None, None)
