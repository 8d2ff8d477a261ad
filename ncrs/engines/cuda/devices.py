"""GPUs: which can be used, and one sentence about each that cannot."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from numba import cuda

from ncrs.engines.base import EngineError, EngineSettingError
from ncrs.engines.cuda.gpu import IS_SIMULATED

MIN_CAPABILITY = (8, 0)
"""The first compute capability with all the instructions in use (NVIDIA Ampere, 2020)."""
_INSTEAD = "choose engine=batched for the CPU."


def check_devices(devices: Sequence[int]) -> None:
    """Raise ``EngineSettingError`` unless all of these GPUs can be used.

    Args:
        devices: Indices, at least one, none of them twice.
    """
    _check_indices(devices)
    if IS_SIMULATED:
        return
    if not cuda.is_available():
        raise EngineSettingError(
            f"No NVIDIA GPU can be used here ({_reason()}); install its driver, or {_INSTEAD}"
        )
    count = len(cuda.gpus)
    for index in devices:
        if index >= count:
            raise EngineSettingError(
                f"There is no GPU {index}: this machine has {count}, numbered from 0."
            )
        with on_device(index):
            gpu = cuda.get_current_device()
            capability = tuple(gpu.compute_capability)[:2]
        if capability < MIN_CAPABILITY:
            raise EngineSettingError(
                f"GPU {index} ({_name(gpu)}) has compute capability "
                f"{capability[0]}.{capability[1]}; at least {MIN_CAPABILITY[0]}."
                f"{MIN_CAPABILITY[1]} is needed: {_INSTEAD}"
            )


def _check_indices(devices: Sequence[int]) -> None:
    indices = list(devices)
    are_indices = all(isinstance(i, int) and not isinstance(i, bool) and i >= 0 for i in indices)
    if not indices or not are_indices or len(set(indices)) < len(indices):
        raise EngineSettingError(
            f"engine.devices must name different GPUs by their indices, such as [0, 1]; got "
            f"{indices!r}."
        )


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
        EngineSettingError: The GPU cannot be used now, such as while another process has it alone.
        EngineError: Its memory was used up, or a kernel failed.
    """
    from numba.cuda.cudadrv.driver import CudaAPIError

    if IS_SIMULATED:
        yield
        return
    try:
        context = cuda.gpus[index]
        context.__enter__()
    except CudaAPIError as error:
        raise EngineSettingError(
            f"GPU {index} cannot be used now ({error}): another process may have it to itself. "
            f"Wait for it, name another in engine.devices, or {_INSTEAD}"
        ) from error
    try:
        yield
    except CudaAPIError as error:
        if "OUT_OF_MEMORY" in str(error):
            raise EngineError(
                f"GPU {index} has too little free memory ({error}): end other processes on it, or "
                "evaluate fewer episodes at once."
            ) from error
        raise EngineError(f"GPU {index} failed ({error}).") from error
    finally:
        context.__exit__(None, None, None)
