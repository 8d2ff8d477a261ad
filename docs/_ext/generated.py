"""Parts of pages that are made from the package; a line `<!-- run_settings -->` stands for one.

The maker's name may be followed by arguments: `<!-- environment NCRS-LightChase-v0 -->`.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from command_lines import command_line, commands
from environment_pages import environment
from error_list import errors
from repository_files import document
from settings_tables import (
    engine_settings,
    optimizer_settings,
    perturbation_settings,
    run_settings,
    task_settings,
)
from sphinx.application import Sphinx

MAKERS: Mapping[str, Callable[..., str]] = {
    "commands": commands,
    "command_line": command_line,
    "document": document,
    "environment": environment,
    "errors": errors,
    "engine_settings": engine_settings,
    "optimizer_settings": optimizer_settings,
    "perturbation_settings": perturbation_settings,
    "run_settings": run_settings,
    "task_settings": task_settings,
}
"""Makers of Markdown, by the names that pages call them with."""
ARCHIVES = Path(__file__).parents[1] / "archives"
"""Reports on archives (``ncrs report RUN --elites champion``), without what all of them share."""
_MARK = re.compile(r"^<!-- (\w+)(.*?) -->$", re.MULTILINE)


def fill(text: str) -> str:
    """Put what their makers return in place of the lines that name one."""
    return _MARK.sub(lambda mark: MAKERS[mark[1]](*mark[2].split()), text)


def _fill_page(app: Sphinx, page: str, source: list[str]) -> None:
    source[0] = fill(source[0])


def _write_live_page(app: Sphinx, error: Exception | None) -> None:
    """Write the page of live robots, which the front page shows."""
    if error is not None or app.builder.format != "html":
        return
    from ncrs.live.build import PAGE_FILE, write_page
    from ncrs.live.robots import published_robots, robot_by_hand

    write_page(Path(app.outdir) / PAGE_FILE, [robot_by_hand(), *published_robots()])


def _write_archive_pages(app: Sphinx, error: Exception | None) -> None:
    """Write the pages of archives, of which the repository holds page and data alone."""
    if error is not None or app.builder.format != "html":
        return
    from ncrs.live.build import PAGE_FILE, write_page
    from ncrs.live.robots import robot_by_hand
    from ncrs.report.build import write_parts

    folder = Path(app.outdir) / ARCHIVES.name
    shutil.copytree(ARCHIVES, folder, dirs_exist_ok=True)
    for page in folder.iterdir():
        write_parts(page)
        write_page(page / PAGE_FILE, [robot_by_hand()])  # shows any robot of the page


def setup(app: Sphinx) -> dict[str, Any]:
    """Fill pages when they are read, and add the other ones when these are written."""
    app.connect("source-read", _fill_page)
    app.connect("build-finished", _write_live_page)
    app.connect("build-finished", _write_archive_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
