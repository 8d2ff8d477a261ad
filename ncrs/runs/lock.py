"""One writer per run: the lock on a run's folder."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from ncrs.runs.checkpoint import writing
from ncrs_envs.errors import NCRSError

_LOCK_FILE = ".lock"


class RunError(NCRSError, RuntimeError):
    """A run that cannot be started or continued in the folder given."""


class RunIsLockedError(RunError):
    """A run that another process is writing."""


@contextmanager
def locked(run_dir: Path) -> Iterator[None]:
    """Lock a run's folder, made if missing, against other processes.

    Raises:
        RunError: If another process has locked it.
        CheckpointError: If it cannot be written.
    """
    with writing(run_dir):
        run_dir.mkdir(parents=True, exist_ok=True)
        lock = FileLock(run_dir / _LOCK_FILE)
        try:
            lock.acquire(timeout=0)
        except Timeout as error:
            raise RunIsLockedError(
                f"Another process is writing to {run_dir}; wait for it, or use another folder."
            ) from error
    try:
        yield
    finally:
        lock.release()
