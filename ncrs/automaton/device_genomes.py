"""Genomes in the memory of a GPU, which come to the CPU only where their numbers are asked for."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


class DeviceGenomes:
    """A population on a GPU; numpy's functions take it as an array.

    Args:
        tensor: Tensor of torch, ``(P, N)``, which nobody changes afterwards.

    Attributes:
        copied: Number of genomes that were copied to the CPU so far.
    """

    def __init__(self, tensor: Any) -> None:
        self.tensor = tensor
        self.copied = 0

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of genomes and of weights."""
        rows, columns = self.tensor.shape
        return int(rows), int(columns)

    def __len__(self) -> int:
        """Return the number of genomes."""
        return self.shape[0]

    def __getitem__(self, rows: Any) -> NDArray[np.float64]:
        """Copy one genome, ``(N,)``, or those of a list or slice, float64 ``(R, N)``."""
        copied: NDArray[np.float64] = np.array(self.tensor[rows].cpu().numpy(), dtype=np.float64)
        self.copied += 1 if copied.ndim == 1 else len(copied)
        return copied

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """Copy all genomes, float64 unless asked otherwise."""
        if copy is False:
            raise ValueError("Genomes on a GPU cannot become an array without a copy.")
        copied: NDArray[Any] = self[:].astype(np.float64 if dtype is None else dtype, copy=False)
        return copied


AnyGenomes = NDArray[np.float64] | DeviceGenomes
"""A population wherever it is, ``(P, N)``."""
