"""Compilation of the batched simulator's kernels, with one set of numba options for all.

Without ``fastmath`` nothing is reassociated; ``error_model="numpy"`` leaves no exceptions in the
kernels; ``nogil`` lets callers run them in threads of their own. Each episode is computed by one
thread from its own arrays alone, so results do not depend on the number of threads.

Compiled kernels are cached on disk. numba's own cache checks only the file that a kernel stands in,
and would keep old code in use after a kernel or a constant in another file has changed. Here a
cached kernel is valid only for the sources, of all first-party modules behind it, that it was
compiled from.

A process that has to compile says so once, since it then seems to hang for most of a minute.
"""

from __future__ import annotations

import hashlib
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

from ncrs_envs.batched.kernel_cache import kernel_cache
from ncrs_envs.notices import notice

Function = TypeVar("Function", bound=Callable[..., Any])

_FIRST_PARTY_IMPORT = re.compile(r"^from (ncrs\w*[\w.]*) import", re.MULTILINE)


def source_digest(module: str) -> str:
    """Return a digest of the sources of a first-party module and its imports, at any depth."""
    sources: dict[str, str] = {}
    pending = [module]
    while pending:
        name = pending.pop()
        file = sys.modules[name].__file__ if name in sys.modules else None
        if name not in sources and file is not None:
            sources[name] = Path(file).read_text(encoding="utf-8")
            pending += _FIRST_PARTY_IMPORT.findall(sources[name])
    digest = hashlib.sha256()
    for name in sorted(sources):
        digest.update(f"{name}\n{sources[name]}\n".encode())
    return digest.hexdigest()


class _Notice:
    """The line that a process prints before it compiles its first kernel."""

    def __init__(self) -> None:
        self._is_due = True

    def give(self) -> None:
        """Print the line, unless this was done."""
        if not self._is_due:
            return
        self._is_due = False
        notice("compiling the simulator for this computer, once; it takes up to a minute")


_NOTICE = _Notice()


def kernel(function: Function) -> Function:
    """Compile a function of scalars, arrays and records at its first call, and cache it on disk."""
    compiled = numba.njit(nogil=True, error_model="numpy")(function)
    cache = kernel_cache(function, source_digest(function.__module__), _NOTICE.give)
    if cache is not None:
        compiled._cache = cache  # what numba's own enable_caching() sets
    return cast(Function, compiled)


def inlined(function: Function) -> Function:
    """Compile a function into the kernels that call it.

    For functions that return tuples of records, which kernels cannot return.
    """
    return cast(Function, numba.njit(inline="always")(function))
