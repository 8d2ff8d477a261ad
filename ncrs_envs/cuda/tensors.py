"""Memory of a GPU that kernels and torch share without copies."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numba import cuda
from numpy.typing import NDArray
from torch.utils.dlpack import from_dlpack

from ncrs_envs.cuda.gpu import IS_SIMULATED
from ncrs_envs.interface import ActionError, OptionError

_REAL = (
    *(torch.float16, torch.bfloat16, torch.float32, torch.float64, torch.bool, torch.uint8),
    *(torch.int8, torch.int16, torch.int32, torch.int64),
)


def check_device_name(device: Any) -> int:
    """Return the index of the GPU that ``device`` names.

    Raises:
        OptionError: It names none, or torch cannot use it.
    """
    try:
        named = torch.device(device)
    except (RuntimeError, TypeError) as error:
        raise OptionError(
            f"device must be 'cpu', 'cuda' or 'cuda:INDEX', got {device!r}."
        ) from error
    if named.type != "cuda":
        raise OptionError(f"device must be 'cpu', 'cuda' or 'cuda:INDEX', got {device!r}.")
    if IS_SIMULATED:
        return 0
    if not torch.cuda.is_available():
        raise OptionError(
            f"device={str(named)!r} needs a GPU that torch can use: install its driver and the "
            "CUDA build of torch, or leave device out for the CPU."
        )
    return torch.cuda.current_device() if named.index is None else named.index


def kernel_view(tensor: torch.Tensor) -> Any:
    """Return a tensor on a GPU as an array for kernels, in the same memory."""
    return tensor.numpy() if IS_SIMULATED else cuda.as_cuda_array(tensor)


class SharedMemory:
    """Arrays on one GPU that kernels see as numba's and learners as torch's.

    Args:
        index: Index of the GPU.
    """

    def __init__(self, index: int) -> None:
        self.device = torch.device("cpu") if IS_SIMULATED else torch.device("cuda", index)

    def zeros(self, shape: tuple[int, ...], dtype: Any) -> tuple[Any, torch.Tensor]:
        """Return new memory, as an array for kernels and as a tensor."""
        kind = torch.from_numpy(np.zeros(0, dtype)).dtype
        with torch.inference_mode(False):  # such tensors could not be written elsewhere
            tensor = torch.zeros(shape, dtype=kind, device=self.device)
        return kernel_view(tensor), tensor

    def tensor(self, array: NDArray[Any]) -> torch.Tensor:
        """Return a copy of an array."""
        return torch.tensor(array, device=self.device)

    @property
    def stream(self) -> Any:
        """Torch's current stream, for launches."""
        if IS_SIMULATED:
            return 0
        handle = torch.cuda.current_stream(self.device).cuda_stream
        return cuda.external_stream(handle) if handle else 0

    def action(self, action: Any, shape: tuple[int, ...]) -> torch.Tensor:
        """Return an action as a tensor of real numbers on the GPU.

        Args:
            action: Tensor on the GPU, or anything with ``__dlpack__`` that lies there.
            shape: Required shape.

        Raises:
            ActionError: It is something else, has another shape, or is on another device.
        """
        try:
            tensor = action if isinstance(action, torch.Tensor) else from_dlpack(action)
        except (AttributeError, BufferError, RuntimeError, TypeError) as error:
            raise ActionError(
                f"action must be a tensor on {self.device}, or have __dlpack__, "
                f"got {type(action).__name__} ({error})."
            ) from error
        if tensor.device != self.device:
            raise ActionError(f"action must be on {self.device}, got one on {tensor.device}.")
        if tuple(tensor.shape) != shape:
            raise ActionError(
                f"action must have shape {shape}, one gas value per cell, got "
                f"{tuple(tensor.shape)}."
            )
        if tensor.dtype not in _REAL or tensor.layout is not torch.strided:
            raise ActionError(
                f"action must be a dense tensor of real numbers, got dtype {tensor.dtype}, "
                f"{tensor.layout}."
            )
        return tensor.detach()
