"""The record of a sweep's job that failed: a file in the job's folder."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from ncrs.runs.checkpoint import write_json, writing
from ncrs.runs.settings import SETTINGS_FILE

FAILURE_FILE = "failed.json"


def save_failure(folder: Path, error: str, overrides: Sequence[str], traceback: str | None) -> None:
    """Record why a job failed.

    Args:
        folder: Folder of the job, made if missing.
        error: Message of the error.
        overrides: Overrides of the job.
        traceback: Traceback of an unexpected error; None for bad input.

    Raises:
        CheckpointError: If the file cannot be written.
    """
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    record = {"error": error, "overrides": list(overrides), "traceback": traceback}
    write_json(folder / FAILURE_FILE, record)


def clear_failure(folder: Path) -> None:
    """Remove the record of an earlier attempt.

    Raises:
        CheckpointError: If it cannot be removed.
    """
    with writing(folder):
        (folder / FAILURE_FILE).unlink(missing_ok=True)


def failure_of(folder: Path) -> str | None:
    """Return the message of a failed job's error; None if the job has not failed."""
    path = folder / FAILURE_FILE
    if not path.is_file():
        return None
    try:
        return str(json.loads(path.read_text())["error"])
    except (ValueError, KeyError, TypeError):
        return f"{path} cannot be read"


def refused_folders(sweep: Path) -> list[Path]:
    """List the folders of jobs that were refused: they hold the record of it, and no run."""
    failed = (record.parent for record in sweep.glob(f"*/{FAILURE_FILE}"))
    return [folder for folder in failed if not (folder / SETTINGS_FILE).is_file()]
