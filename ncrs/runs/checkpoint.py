"""Checkpoints: nested dicts of arrays and JSON values in one file, written atomically.

A file is an uncompressed ``.npz``: the arrays, and one JSON text that holds all else. Reading it
executes nothing. Truncated or altered files are recognised: all checksums are verified before the
contents are used.
"""

from __future__ import annotations

import io
import json
import math
import os
import threading
import warnings
import zipfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.errors import NCRSError

FORMAT = 1
"""Version of the files' format; a reader refuses others by name."""
_JSON_MEMBER = "json"
_ARRAY_KEY = "__array__"
_PATTERN = "generation_*.npz"
_KEPT = 2
CHECKPOINT_FOLDER = "checkpoints"
"""Name of the folder in a run's folder."""
_TEMPORARY = ".tmp"
_DAMAGED = ".damaged"


class CheckpointError(NCRSError, RuntimeError):
    """A checkpoint that cannot be written or read."""


class DamagedCheckpointError(CheckpointError):
    """A file whose contents are not those that were written."""


class ForeignFileError(DamagedCheckpointError):
    """A file of arrays that is whole, but that ``write_state`` did not write."""


class CheckpointWarning(UserWarning):
    """A damaged checkpoint was skipped for the one before it."""


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn the file system's errors in the block into a ``CheckpointError``.

    The block promises that earlier contents survive: it appends, or replaces whole files.

    Args:
        path: File or folder that is written, for the message.

    Raises:
        CheckpointError: If the block raises ``OSError``.
    """
    try:
        yield
    except OSError as error:
        raise CheckpointError(
            f"Could not write {path}: {error.strerror or error}. What was saved before is intact; "
            "free space, change permissions, or use another folder."
        ) from error


def write_atomically(path: Path, write: Callable[[BinaryIO], Any]) -> None:
    """Write a file so that at any moment the old or the new one exists, whole.

    Raises:
        CheckpointError: If the disk is full, or the folder cannot be written. The old file is
            intact then.
    """
    # A fixed name: the next write replaces any file that a killed process has left.
    temporary = path.with_name(f".{path.name}{_TEMPORARY}")
    with writing(path):
        try:
            with temporary.open("wb") as stream:
                write(stream)
            replace_synced(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)


def replace_synced(made: Path, path: Path) -> None:
    """Put a finished file in another one's place, so that a power cut leaves one of them whole."""
    _sync(made, os.O_RDWR)
    made.replace(path)
    _sync_folder(path.parent)


def sync_files(folder: Path, paths: Iterable[Path]) -> None:
    """Wait until files that were appended to, and their folder, are on the disk.

    Raises:
        CheckpointError: If the disk is full or broken.
    """
    with writing(folder):
        for path in paths:
            _sync(path, os.O_RDWR)
        _sync_folder(folder)


def _sync_folder(folder: Path) -> None:
    if hasattr(os, "O_DIRECTORY"):  # Windows cannot open folders
        _sync(folder, os.O_RDONLY | os.O_DIRECTORY)


def _sync(path: Path, flags: int) -> None:
    descriptor = os.open(path, flags)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_json(path: Path, value: Any) -> None:
    """Write a value as indented JSON, atomically."""
    text = json.dumps(value, indent=2) + "\n"
    write_atomically(path, lambda stream: stream.write(text.encode()))


def write_state(path: Path, state: dict[str, Any]) -> None:
    """Write a nested dict of arrays and JSON values, atomically.

    Raises:
        CheckpointError: If it could not be written.
        TypeError: If the state holds something else.
    """
    arrays: dict[str, NDArray[Any]] = {}
    text = json.dumps({"format": FORMAT, "state": _take_arrays(state, arrays)})
    arrays[_JSON_MEMBER] = np.frombuffer(text.encode(), dtype=np.uint8)
    write_atomically(path, lambda stream: np.savez(stream, **arrays))  # type: ignore[arg-type]


def read_state(path: Path) -> dict[str, Any]:
    """Read a file that ``write_state`` wrote.

    Raises:
        CheckpointError: If the file cannot be read, or has another format.
        DamagedCheckpointError: If it is truncated, altered, or something else.
        ForeignFileError: If it holds nothing but arrays, as numpy saves them.
    """
    try:
        content = io.BytesIO(path.read_bytes())
    except OSError as error:
        raise CheckpointError(f"Could not read {path}: {error.strerror or error}.") from error
    try:
        # numpy reads an array only as far as its header says, and may not reach the checksum.
        with zipfile.ZipFile(content) as members:
            _check_sizes(members)
            altered = members.testzip()
        if altered is not None:
            raise zipfile.BadZipFile(f"{altered} does not have its checksum")
        content.seek(0)
        with np.load(content, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        if _JSON_MEMBER not in arrays:
            raise ForeignFileError(
                f"{path} holds the arrays {sorted(arrays)}, and no checkpoint, champion or archive."
            )
        stored = json.loads(arrays[_JSON_MEMBER].tobytes())
    except (MemoryError, ForeignFileError):
        raise
    except Exception as error:  # from altered bytes zipfile and numpy raise nearly anything
        raise DamagedCheckpointError(f"{path} is not a whole checkpoint: {error}.") from error
    found = stored.get("format") if isinstance(stored, dict) else None
    if found != FORMAT:
        raise CheckpointError(
            f"{path} has the format {found!r}; this version of ncrs reads {FORMAT}. Use the "
            "version that wrote it."
        )
    state: dict[str, Any] = _put_arrays(stored["state"], arrays)
    return state


def _check_sizes(members: zipfile.ZipFile) -> None:
    """Check that no member is larger than the file can hold, before any is read.

    Raises:
        zipfile.BadZipFile: If a member is compressed, or its header declares another size.
    """
    for member in members.infolist():
        if member.compress_type != zipfile.ZIP_STORED:
            raise zipfile.BadZipFile(f"{member.filename} is compressed, as ncrs never writes it")
        with members.open(member) as stream:
            version = np.lib.format.read_magic(stream)
            read = np.lib.format.read_array_header_1_0
            if version != (1, 0):
                read = np.lib.format.read_array_header_2_0
            shape, _, dtype = read(stream)
            declared = stream.tell() + math.prod(shape) * dtype.itemsize
        if declared != member.file_size:
            raise zipfile.BadZipFile(
                f"{member.filename} declares {declared:,} bytes and has {member.file_size:,}"
            )


def _take_arrays(value: Any, arrays: dict[str, NDArray[Any]]) -> Any:
    if isinstance(value, np.ndarray):
        if value.dtype == object:
            raise TypeError("A checkpoint cannot hold arrays of Python objects.")
        name = f"array{len(arrays)}"
        arrays[name] = value
        return {_ARRAY_KEY: name}
    if isinstance(value, dict):
        return {key: _take_arrays(item, arrays) for key, item in value.items()}
    if isinstance(value, list):
        return [_take_arrays(item, arrays) for item in value]
    return value


def _put_arrays(value: Any, arrays: dict[str, NDArray[Any]]) -> Any:
    if isinstance(value, dict):
        if set(value) == {_ARRAY_KEY}:
            return arrays[value[_ARRAY_KEY]]
        return {key: _put_arrays(item, arrays) for key, item in value.items()}
    if isinstance(value, list):
        return [_put_arrays(item, arrays) for item in value]
    return value


class CheckpointFolder:
    """The newest two checkpoints of a run.

    Args:
        folder: Folder of the checkpoints, made if missing.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._writer: threading.Thread | None = None
        self._failure: BaseException | None = None

    def paths(self) -> list[Path]:
        """Existing checkpoints, newest first."""
        return sorted(self.folder.glob(_PATTERN), reverse=True)

    def save(self, generation: int, state: dict[str, Any]) -> Path:
        """Write the state from which ``generation`` starts; drop all but the newest two.

        Raises:
            CheckpointError: If it could not be written, or the background save before it failed.
        """
        self.wait()
        return self._write(generation, state)

    def save_in_background(self, generation: int, state: dict[str, Any]) -> None:
        """Start a ``save`` in a thread and return, so that a large state stalls nothing.

        Waits for a save that is under way. The arrays of ``state`` must not change until this one
        has ended; the optimizers' states are copies.

        Raises:
            CheckpointError: If the save before this one failed.
        """
        self.wait()
        self._writer = threading.Thread(
            target=self._write_and_keep_failure, args=(generation, state)
        )
        self._writer.start()

    @property
    def is_writing(self) -> bool:
        """True while a background save is under way."""
        return self._writer is not None and self._writer.is_alive()

    def wait(self) -> None:
        """Return when nothing is being written; raise any error of the last background save."""
        if self._writer is not None:
            self._writer.join()
            self._writer = None
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def _write_and_keep_failure(self, generation: int, state: dict[str, Any]) -> None:
        try:
            self._write(generation, state)
        except BaseException as error:  # a thread has no caller: ``wait`` raises it
            self._failure = error

    def _write(self, generation: int, state: dict[str, Any]) -> Path:
        with writing(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
            for unfinished in self.folder.glob(f".*{_TEMPORARY}"):
                unfinished.unlink()  # left by a process that was killed while writing
        path = self.folder / f"generation_{generation:08d}.npz"
        write_state(path, state)
        with writing(self.folder):
            for old in self.paths()[_KEPT:]:
                old.unlink()
        return path

    def load(self) -> dict[str, Any]:
        """Read the newest whole checkpoint; warn about each damaged one that is skipped.

        Damaged ones are renamed, so that they do not count among the newest two.

        Raises:
            CheckpointError: If there is no whole one, one cannot be read, or a damaged one cannot
                be renamed.
        """
        self.wait()
        damaged: dict[Path, str] = {}
        for path in self.paths():
            try:
                state = read_state(path)
            except DamagedCheckpointError as error:
                damaged[path] = str(error)
                continue
            for skipped, message in damaged.items():
                renamed = skipped.with_name(skipped.name + _DAMAGED)
                with writing(self.folder):
                    skipped.replace(renamed)
                warnings.warn(
                    f"{message} It is now {renamed.name}; the run resumes from {path.name}.",
                    CheckpointWarning,
                    2,
                )
            return state
        if damaged:
            reasons = " ".join(damaged.values())
            raise CheckpointError(f"No whole checkpoint in {self.folder}: {reasons}")
        raise CheckpointError(f"No checkpoint in {self.folder}: the run was not started there.")


def generations_done(folder: Path) -> int:
    """Return the generations done until the newest checkpoint in a folder; 0 without one."""
    paths = CheckpointFolder(folder).paths()
    return int(paths[0].stem.rpartition("_")[2]) if paths else 0
