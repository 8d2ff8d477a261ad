"""Building of the page: one file that holds the engine, the robots, and all that draws them."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import re
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from ncrs.live.engine import engine_code
from ncrs.live.robots import LiveError, LiveRobot
from ncrs.live.world import live_world
from ncrs.runs.checkpoint import write_atomically
from ncrs.runs.seeds import Stream, seed_sequence
from ncrs_envs.body import body_to_characters
from ncrs_envs.scenario import sample_scenarios
from ncrs_envs.tasks import PAPER_TASKS, REGIONS, TaskSettings

GRID_SIZES = (5, 7, 9)
"""Sides of the grids that a page offers, besides those of its robots."""
PAGE_FILE = "live.html"
DRAWING = ("colors.js", "drawing.js")
"""Scripts that draw robots and playfields, on any page."""
SHARED = ("dom.js", *DRAWING)
"""Scripts that other pages share."""
BASE_STYLE = "base.css"
_STYLES = (BASE_STYLE, "live.css")
_SCRIPTS = (
    "session.js",
    "data.js",
    "walls.js",
    "stage.js",
    "editor.js",
    "panels.js",
    "files.js",
    "link.js",
    "controls.js",
    "choice.js",
    "app.js",
)
_MARK = re.compile(r"@(\w+)@")


@dataclass(frozen=True)
class LivePage:
    """A written page."""

    path: Path
    robots: int
    """Number of robots on it."""
    size: int
    """Size of the file in bytes."""


def page_part(name: str) -> str:
    """Return the text of one of the page's parts."""
    return (files("ncrs.live") / "page" / name).read_text(encoding="utf-8")


def write_page(path: Path, robots: Sequence[LiveRobot], seed: int = 0) -> LivePage:
    """Write a page, in place of an older one.

    Args:
        path: File to write.
        robots: Robots to choose from; the first lives when the page opens.
        seed: Seed for sampling the courses.

    Raises:
        LiveError: If there are no robots, or one's task has rules of its own.
        SeedError: If the seed is not a non-negative integer.
        CheckpointError: If the file cannot be written.
    """
    content = page_text(robots, seed).encode()
    write_atomically(path, lambda stream: stream.write(content))
    return LivePage(path, len(robots), len(content))


def page_text(robots: Sequence[LiveRobot], seed: int = 0) -> str:
    """Return the page's HTML; arguments and errors as in ``write_page``."""
    if not robots:
        raise LiveError("A page needs at least one robot.")
    scripts = [page_part(name) for name in SHARED]
    scripts += [engine_code(), *(page_part(name) for name in _SCRIPTS)]
    scripts = [_compact(script) for script in scripts]
    style = _compact("\n".join(page_part(name) for name in _STYLES))
    parts = {
        "policy": _policy(scripts, style),
        "style": style,
        "data": json.dumps(_data(robots, seed), separators=(",", ":")),
        "scripts": "\n".join(f"<script>{script}</script>" for script in scripts),
    }
    return _MARK.sub(lambda mark: parts[mark[1]], page_part("live.html"))


def _compact(text: str) -> str:
    """Leave out indents and lines that are comments; scripts have no texts of several lines."""
    lines = (line.strip() for line in text.splitlines())
    return "\n".join(line for line in lines if line and not line.startswith("//"))


def _policy(scripts: Iterable[str], style: str) -> str:
    """Return the policy that allows the page's own scripts and style, and nothing else."""

    def digest(text: str) -> str:
        return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"

    return (
        f"default-src 'none'; script-src {' '.join(map(digest, scripts))}; "
        f"style-src {digest(style)}; img-src data:; base-uri 'none'; form-action 'none'"
    )


def _data(robots: Sequence[LiveRobot], seed: int) -> dict[str, str]:
    """Return what the page reads: base64 of deflated JSON, and of deflated genomes.

    The alphabet of base64 holds no character that could end the element around it.
    """
    worlds: dict[str, dict[int, Any]] = {}
    for settings in _settings(robots):
        courses = sample_scenarios(
            settings.task, seed_sequence(seed, Stream.REPORT), REGIONS, settings.grid_size
        )
        worlds.setdefault(settings.name, {})[settings.grid_size] = live_world(settings, courses)
    content = {"worlds": worlds, "robots": [_entry(robot) for robot in robots]}
    genomes = np.concatenate([robot.robot.genome for robot in robots]).astype("<f4")
    return {
        "content": _packed(json.dumps(content, allow_nan=False).encode()),
        "genomes": _packed(genomes.tobytes()),
    }


def _settings(robots: Sequence[LiveRobot]) -> list[TaskSettings]:
    """Return the settings of each task on each grid size; tasks of robots come first."""
    tasks = {robot.robot.task.name: robot.robot.task for robot in robots}
    for name, task in tasks.items():
        if task.needs_box2d:
            raise LiveError(
                f"{name} {task.not_compiled}, which a page cannot run; use ncrs film or ncrs play."
            )
    for known in PAPER_TASKS:
        tasks.setdefault(known.name, TaskSettings(known.name))
    sizes = {robot.robot.task.grid_size for robot in robots} | set(GRID_SIZES)
    return [
        TaskSettings(name, size, task.distance_score, task.success_radius)
        for name, task in tasks.items()
        for size in sorted(sizes)
    ]


def _entry(live: LiveRobot) -> dict[str, Any]:
    robot = live.robot
    return {
        "id": robot.title,
        "title": robot.title,
        "task": robot.task.name,
        "gridSize": robot.task.grid_size,
        "distanceScore": robot.task.distance_score,
        "successRadius": robot.task.radius,
        "fitness": None if math.isnan(live.fitness) else live.fitness,
        "success": None if math.isnan(live.success) else live.success,
        "episodes": live.episodes,
        "note": live.note,
        "follows": live.follows,
        "body": body_to_characters(robot.body).replace("\n", ""),
    }


def _packed(content: bytes) -> str:
    deflate = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    return base64.b64encode(deflate.compress(content) + deflate.flush()).decode("ascii")
