"""The GPUs that an engine uses, with the engine's own errors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from ncrs.engines.base import EngineError, EngineSettingError
from ncrs_envs.cuda import devices as gpus
from ncrs_envs.cuda.devices import FailedGPUError, UnusableGPUError

_INSTEAD = "Name another in engine.devices, or choose engine=batched for the CPU."


def check_devices(devices: Sequence[int]) -> None:
    """Raise ``EngineSettingError`` unless all of these GPUs can be used.

    Args:
        devices: Indices, at least one, none of them twice.
    """
    indices = list(devices)
    are_indices = all(isinstance(i, int) and not isinstance(i, bool) and i >= 0 for i in indices)
    if not indices or not are_indices or len(set(indices)) < len(indices):
        raise EngineSettingError(
            f"engine.devices must name different GPUs by their indices, such as [0, 1]; got "
            f"{indices!r}."
        )
    for index in indices:
        try:
            gpus.check_device(index)
        except UnusableGPUError as error:
            raise EngineSettingError(f"{error} {_INSTEAD}") from error


@contextmanager
def on_device(index: int) -> Iterator[None]:
    """Make a GPU the current one of this thread.

    Raises:
        EngineSettingError: The GPU cannot be used now, such as while another process has it alone.
        EngineError: Its memory was used up, or a kernel failed.
    """
    try:
        with gpus.on_device(index):
            yield
    except UnusableGPUError as error:
        raise EngineSettingError(f"{error} {_INSTEAD}") from error
    except FailedGPUError as error:
        raise EngineError(str(error)) from error
