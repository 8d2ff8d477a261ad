"""The folder of a report: a new report replaces the files of the old one, and nothing else."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from ncrs.report.robots import ReportError
from ncrs.runs.checkpoint import write_json, writing

MANIFEST_FILE = "manifest.json"
"""Names of the files that the report wrote."""


def check_folder(folder: Path) -> None:
    """Refuse to write into anything but a report, or an empty or missing folder.

    Raises:
        ReportError: If the folder holds something else, or is a link.
    """
    if folder.is_symlink():
        raise ReportError(f"{folder} is a link; give the folder itself.")
    if not folder.exists():
        return
    if not folder.is_dir() or (any(folder.iterdir()) and _manifest(folder) is None):
        raise ReportError(
            f"{folder} exists and is not a report; give another folder, or remove it first."
        )


def _manifest(folder: Path) -> list[Path] | None:
    """Read which files a report wrote, as paths below its folder; None without a manifest."""
    try:
        names = json.loads((folder / MANIFEST_FILE).read_text(encoding="utf-8"))["files"]
        paths = [PurePosixPath(name) for name in names]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    if any(path.is_absolute() or ".." in path.parts for path in paths):
        return None
    return [Path(path) for path in paths]


@contextmanager
def new_report(folder: Path) -> Iterator[Path]:
    """Yield an empty folder, whose files replace those of the older report after the block.

    Other files in the folder stay. If the block fails, the older report stays as it was.

    Raises:
        ReportError: If the folder holds something else than a report.
        CheckpointError: If it cannot be written.
    """
    check_folder(folder)
    # A fixed name beside the folder: a process that was killed leaves nothing that stays.
    made = folder.with_name(f".{folder.name}.tmp")
    with writing(folder):
        shutil.rmtree(made, ignore_errors=True)
        made.mkdir(parents=True)
        try:
            yield made
            _replace(made, folder)
        finally:
            shutil.rmtree(made, ignore_errors=True)


def _replace(made: Path, folder: Path) -> None:
    before = _manifest(folder) or []
    files = sorted(path.relative_to(made) for path in made.rglob("*") if path.is_file())
    folder.mkdir(exist_ok=True)
    _write_manifest(folder, {*before, *files})
    # Pages last: they show what the data files hold.
    for file in sorted(files, key=lambda file: (file.suffix == ".html", file)):
        target = folder / file
        if target.parent != folder and target.parent.is_symlink():
            raise ReportError(f"{target.parent} is a link; remove it first.")
        target.parent.mkdir(exist_ok=True)
        (made / file).replace(target)
    for file in set(before) - set(files):
        if not (folder / file).parent.is_symlink():
            (folder / file).unlink(missing_ok=True)
    _write_manifest(folder, files)


def _write_manifest(folder: Path, files: Iterable[Path]) -> None:
    write_json(folder / MANIFEST_FILE, {"files": sorted(file.as_posix() for file in files)})
