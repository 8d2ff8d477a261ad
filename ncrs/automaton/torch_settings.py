"""torch as this package needs it, whatever the program around it has set."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import torch


@contextmanager
def plain_torch() -> Iterator[None]:
    """Let torch compute within the block as a new process does.

    Autocast and other convolutions would round otherwise. The default dtype and device need no
    care: all tensors are made with their own.
    """
    with torch.autocast("cpu", enabled=False), _plain_onednn():
        yield


@contextmanager
def _plain_onednn() -> Iterator[None]:
    """Let convolutions run on oneDNN, in full precision."""
    onednn: Any = torch.backends.mkldnn
    owners: list[tuple[Any, str, Any]] = [(onednn, "enabled", True)]
    if hasattr(onednn, "conv"):  # a setting of newer versions
        owners.append((onednn.conv, "fp32_precision", "ieee"))
    before = [getattr(owner, name) for owner, name, _ in owners]
    for owner, name, value in owners:
        setattr(owner, name, value)
    try:
        yield
    finally:
        for (owner, name, _), value in zip(owners, before, strict=True):
            setattr(owner, name, value)


@contextmanager
def one_torch_thread() -> Iterator[None]:
    """Let torch compute within the block as a new process does, on one thread.

    The arithmetic of a genome must not depend on the number of threads, and for a single NCA, the
    threads spend more time waiting for each other than computing.
    """
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with plain_torch():
            yield
    finally:
        torch.set_num_threads(threads)
