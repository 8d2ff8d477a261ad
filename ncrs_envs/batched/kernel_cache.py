"""The disk cache of compiled kernels: whatever happens to its files, compiling still works.

Each file begins with the digest of its content. A file that was truncated, zeroed or altered is
removed and compiled again; loading it could crash the process. Without a writable place, or on a
full disk, kernels are compiled in memory.
"""

from __future__ import annotations

import hashlib
import pickle
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba.core.caching import FunctionCache, IndexDataCacheFile

_DIGEST = hashlib.sha256
_SIZE = _DIGEST().digest_size


class KernelCacheWarning(RuntimeWarning):
    """Compiled kernels that cannot be kept on disk."""


_warned: set[str] = set()


def _warn(reason: object) -> None:
    """Say once that kernels are not kept."""
    if _warned:
        return
    _warned.add("said")
    warnings.warn(
        f"Compiled kernels cannot be kept on disk ({reason}); every process compiles them again. "
        "Free space, or name a writable folder in NUMBA_CACHE_DIR.",
        KernelCacheWarning,
        stacklevel=2,
    )


class _CheckedFiles(IndexDataCacheFile):  # type: ignore[misc] # numba has no types
    """numba's files of one function, each with the digest of its content in front."""

    def _save_index(self, overloads: dict[Any, str]) -> None:
        content = pickle.dumps((self._version, self._dump((self._source_stamp, overloads))))
        self._write(self._index_path, content)

    def _load_index(self) -> dict[Any, str]:
        content = self._read(self._index_path)
        if content is None:
            return {}
        version, data = pickle.loads(content)
        if version != self._version:
            return {}
        stamp, overloads = pickle.loads(data)
        return overloads if stamp == self._source_stamp else {}

    def _save_data(self, name: str, data: Any) -> None:
        self._write(self._data_path(name), self._dump(data))

    def _load_data(self, name: str) -> Any:
        content = self._read(self._data_path(name))
        if content is None:
            raise FileNotFoundError(name)  # which numba takes as a reason to compile
        return pickle.loads(content)

    def _write(self, path: str, content: bytes) -> None:
        with self._open_for_write(path) as stream:
            stream.write(_DIGEST(content).digest() + content)

    @staticmethod
    def _read(path: str) -> bytes | None:
        """Read a file's content; remove the file if that is not what was written."""
        try:
            data = Path(path).read_bytes()
        except OSError:
            return None
        content = data[_SIZE:]
        if _DIGEST(content).digest() == data[:_SIZE]:
            return content
        Path(path).unlink(missing_ok=True)
        return None


class KernelCache(FunctionCache):  # type: ignore[misc] # numba has no types
    """numba's disk cache, whose entries are valid for one state of the sources only.

    Args:
        function: Function to compile.
        digest: Digest of all sources that it is compiled from.
        notice: Function to call before numba compiles.
    """

    def __init__(
        self, function: Callable[..., Any], digest: str, notice: Callable[[], None]
    ) -> None:
        super().__init__(function)
        self._cache_file = _CheckedFiles(
            self._cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp()
        )
        self._digest = digest
        self._notice = notice

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """Load a kernel from the disk; without one numba compiles it next, so say so."""
        try:
            found = super().load_overload(signature, target_context)
        except Exception as error:  # pickle and LLVM raise anything for what another build wrote
            _warn(error)
            found = None
        if found is None:
            self._notice()
        return found

    def save_overload(self, signature: Any, data: Any) -> None:
        """Keep a compiled kernel, if the disk takes it."""
        try:
            super().save_overload(signature, data)
        except OSError as error:
            self.disable()
            _warn(error.strerror or error)

    def _index_key(self, signature: Any, codegen: Any) -> Any:
        return (*super()._index_key(signature, codegen), self._digest)


def kernel_cache(
    function: Callable[..., Any], digest: str, notice: Callable[[], None]
) -> KernelCache | None:
    """Make the cache of a function; None if there is no place for it, which is said once."""
    try:
        return KernelCache(function, digest, notice)
    except (RuntimeError, OSError) as error:  # numba found no locator
        _warn(error)
        return None
