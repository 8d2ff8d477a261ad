"""The record of a sweep's job that failed: a file in the job's folder."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from ncrs.runs.checkpoint import write_json, writing

FAILURE_FILE = "failed.json"
REFUSAL_FILE = "refused.json"
HYDRA_FOLDER = ".hydra"


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


def save_refusal(folder: Path, error: str) -> None:
    """Record that a sweep refused to touch the run in a folder, which is not the run's failure.

    Raises:
        CheckpointError: If the file cannot be written.
    """
    write_json(folder / REFUSAL_FILE, {"error": error})


def refusals(sweep: Path) -> list[Path]:
    """List the records of what a sweep refused."""
    return sorted(sweep.glob(f"*/{REFUSAL_FILE}"))


def clear_refusals(sweep: Path) -> None:
    """Remove what an earlier start of a sweep left of refused jobs: records, and empty folders.

    Raises:
        CheckpointError: If a file cannot be removed.
    """
    with writing(sweep):
        for record in refusals(sweep):
            record.unlink()
        for record in sorted(sweep.glob(f"*/{FAILURE_FILE}")):
            folder = record.parent
            names = {path.name for path in folder.iterdir()}
            if names <= {FAILURE_FILE, HYDRA_FOLDER}:
                record.unlink()
                for file in (folder / HYDRA_FOLDER).glob("*.yaml"):
                    file.unlink()
                if (folder / HYDRA_FOLDER).is_dir():
                    (folder / HYDRA_FOLDER).rmdir()
                folder.rmdir()
