"""A layer under Python's file operations, which counts them in a folder and lets one of them fail.

In the manner of SQLite's crash tests: every operation of a command is a point at which its process
may die, or its disk may fail. Operations are named by kind, file and occurrence, such as
"write checkpoints/.generation_00000001.npz.tmp 3", since several threads write.
"""

from __future__ import annotations

import builtins
import errno
import io
import os
import re
import threading
from collections import Counter
from pathlib import Path
from typing import Any

DIED = 137
"""Exit code of a process that died at its point."""
DIE, TEAR, LOSE = "die", "tear", "lose"
"""The process dies before the operation; halfway through a write; or so that what was not synced
is lost, as in a power cut."""
ERRORS = {"ENOSPC": errno.ENOSPC, "EIO": errno.EIO, "EACCES": errno.EACCES}
MODES = (DIE, TEAR, LOSE, *ERRORS)
_VARYING = re.compile(r"\d{6,}\.\S+|(?<=[-_])[0-9a-z_]{8}(?=$|\.)")
_KEPT = re.compile(r"generation_\d{8}")


def modes_of(point: str) -> list[str]:
    """List what can go wrong at a point."""
    kind = point.split()[0]
    if kind == "write":
        return [TEAR, LOSE, "ENOSPC", "EIO"]
    if kind in ("open", "mkdir"):
        return [DIE, "ENOSPC", "EACCES"]
    if kind == "fsync":
        return [LOSE, "EIO"]
    return [DIE, LOSE, "EACCES"]


class FileLayer:
    """The layer, for one process that is not used afterwards.

    Args:
        root: Folder whose files count.
        point: Name of the operation to fail at; None only to count.
        mode: What happens there, one of ``MODES``.
    """

    def __init__(self, root: Path, point: str | None = None, mode: str = DIE) -> None:
        self.root = os.path.realpath(root)
        self.points: list[str] = []
        self._point, self._mode = point, mode
        self._is_full = False
        self._seen: Counter[str] = Counter()
        self._synced: dict[int, tuple[str, int]] = {}
        self._lock = threading.RLock()
        self._open = io.open

    def install(self) -> None:
        """Put the layer under this process; it stays."""
        builtins.open = io.open = self._opened  # type: ignore[assignment]
        for name in ("replace", "rename", "unlink", "remove", "rmdir", "mkdir", "truncate"):
            self._wrap(name, getattr(os, name))
        self._os_open, self._fsync = os.open, os.fsync
        os.open = self._opened_descriptor  # type: ignore[assignment]
        os.fsync = self._synced_descriptor  # type: ignore[assignment]

    def _wrap(self, name: str, function: Any) -> None:
        def wrapped(path: Any, *others: Any, **options: Any) -> Any:
            found = self._inside(path, options.get("dir_fd"))
            if found is not None:
                self._reach(name, found)
            result = function(path, *others, **options)
            if name in ("replace", "rename") and found is not None:
                self._moved(os.path.join(self.root, found), os.path.realpath(others[0]))
            return result

        setattr(os, name, wrapped)

    def _inside(self, path: Any, folder: int | None = None) -> str | None:
        """Path below the root; None for one elsewhere."""
        if isinstance(path, int):
            path = os.readlink(f"/proc/self/fd/{path}")
        text = os.fsdecode(path)
        if folder is not None:
            text = os.path.join(os.readlink(f"/proc/self/fd/{folder}"), text)
        parent = os.path.realpath(os.path.dirname(os.path.abspath(text)))
        full = os.path.join(parent, os.path.basename(text))
        return os.path.relpath(full, self.root) if full.startswith(self.root + os.sep) else None

    def _reach(self, kind: str, path: str) -> str:
        """Note an operation, and fail if it is the one to fail at; returns its name."""
        with self._lock:
            name = f"{kind} {_stable(path)}"
            self._seen[name] += 1
            point = f"{name} {self._seen[name]}"
            self.points.append(point)
            if point == self._point:
                self._fail(path)
            if self._is_full and kind in ("write", "mkdir", "open"):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), path)
            return point

    def _fail(self, path: str) -> None:
        if self._mode == "ENOSPC":
            self._is_full = True  # and stays so
        elif self._mode in ERRORS:
            raise OSError(ERRORS[self._mode], os.strerror(ERRORS[self._mode]), path)
        elif self._mode == LOSE:
            self._lose()
        if self._mode in (DIE, LOSE):
            os._exit(DIED)

    def _lose(self) -> None:
        """Cut every file back to what was synced."""
        for number, (path, size) in self._synced.items():
            if os.path.exists(path) and os.stat(path).st_ino == number:
                with self._open(path, "r+b") as stream:
                    stream.truncate(min(size, os.stat(path).st_size))

    def written(self, stream: io.FileIO, data: Any) -> None:
        """Note a write, before it happens."""
        path = self._inside(stream.fileno())
        assert path is not None
        number = os.fstat(stream.fileno()).st_ino
        with self._lock:
            self._synced.setdefault(number, (os.path.join(self.root, path), stream.tell()))
            point = self._reach("write", path)
            if self._mode == TEAR and point == self._point:
                os.write(stream.fileno(), bytes(data)[: len(data) // 2])
                os._exit(DIED)

    def _moved(self, old: str, new: str) -> None:
        with self._lock:
            for number, (path, size) in self._synced.items():
                if path == old:
                    self._synced[number] = (new, size)

    def _synced_descriptor(self, descriptor: int) -> None:
        path = self._inside(descriptor)
        if path is not None and os.path.isfile(os.path.join(self.root, path)):
            self._reach("fsync", path)
            state = os.fstat(descriptor)
            with self._lock:
                self._synced[state.st_ino] = (os.path.join(self.root, path), state.st_size)
        self._fsync(descriptor)

    def _opened_descriptor(self, path: Any, flags: int, *others: Any, **options: Any) -> int:
        if flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
            found = self._inside(path, options.get("dir_fd"))
            if found is not None:
                self._reach("open", found)
        return self._os_open(path, flags, *others, **options)

    def _opened(self, file: Any, mode: str = "r", buffering: int = -1, *others: Any, **opts: Any):
        if not set(mode) & set("wax+") or self._inside(file) is None:
            return self._open(file, mode, buffering, *others, **opts)
        found = self._inside(file)
        assert found is not None
        if not isinstance(file, int):
            self._reach("open", found)
        raw_options = {name: opts.pop(name) for name in ("closefd", "opener") if name in opts}
        raw = _Raw(file, mode.replace("b", "").replace("t", ""), **raw_options)
        raw.layer = self
        if buffering == 0:
            return raw
        buffer: Any = (io.BufferedRandom if "+" in mode else io.BufferedWriter)(raw)
        if "b" in mode:
            return buffer
        text = io.TextIOWrapper(buffer, *others, line_buffering=buffering == 1, **opts)
        text.mode = mode
        return text


class _Raw(io.FileIO):
    layer: FileLayer

    def write(self, data: Any) -> int:
        self.layer.written(self, data)
        return super().write(data)


def _stable(path: str) -> str:
    """Name a file as in another process: without a time, a process number or a random part."""
    parts = [part if _KEPT.search(part) else _VARYING.sub("*", part) for part in path.split(os.sep)]
    return os.sep.join(parts)
