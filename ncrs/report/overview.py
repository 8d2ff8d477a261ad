"""A report's summary of the run, and the table of its robots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ncrs.automaton.channels import nca_layout
from ncrs.report.curves import Curve
from ncrs.report.robots import Robots
from ncrs.runs.settings import TrainConfig
from ncrs.runs.wording import duration
from ncrs_envs import canvas
from ncrs_envs.body import CELL_CHARACTERS, CELL_SIZE, SENSOR_CELLS, Cell, body_to_characters
from ncrs_envs.physics import BALL_RADIUS, DT, LIGHT_RADIUS, TARGET_SIDE
from ncrs_envs.scenario import WALL_EXTENT, Scenario, wall_quads
from ncrs_envs.tasks import MAX_EPISODE_STEPS, Task, TaskSettings, playfield

CHARTS: Sequence[tuple[str, Mapping[str, str]]] = (
    (
        "Fitness",
        {
            "fitness/best": "best of the generation",
            "fitness/mean": "mean of the generation",
            "champion/fitness": "champion, on scenarios set aside",
        },
    ),
    (
        "Success",
        {
            "success/best": "best of the generation",
            "success/mean": "mean of the generation",
            "champion/success": "champion, on scenarios set aside",
        },
    ),
    (
        "Archive",
        {"qd/filled_fraction": "triples filled", "qd/qd_score": "QD score"},
    ),
)
"""Title of each chart, and the names of its curves by tag."""

_COLORS: Mapping[str, canvas.Color] = {
    "amber": canvas.AMBER,
    "sky": canvas.SKY,
    "green": canvas.GREEN,
    "vermilion": canvas.VERMILION,
    "white": canvas.WHITE,
    "ground": canvas.GROUND,
    "grid": canvas.GRID,
    "border": canvas.BORDER,
    "wall": canvas.WALL,
    "wall_edge": canvas.WALL_EDGE,
    "tissue": canvas.TISSUE,
    "cell_edge": canvas.CELL_EDGE,
    "sensor_base": canvas.SENSOR_BASE,
    "wheel_base": canvas.WHEEL_BASE,
}
_PLACEMENT_DECIMALS = 2
"""Number of decimals that are kept of placements, in units."""


def _last(curves: Mapping[str, Curve], tag: str) -> float | None:
    curve = curves.get(tag)
    return None if curve is None or not len(curve.values) else float(curve.values[-1])


def title(task: Task, config: TrainConfig | None) -> str:
    """Return the title of a report: the task, and the optimizer if it is known."""
    return task.title if config is None else f"{task.title}, {config.optimizer.name}"


def facts(
    config: TrainConfig | None, robots: Robots, curves: Mapping[str, Curve]
) -> dict[str, str]:
    """Summarise the run in a few lines, as names and values."""
    lines = {"Task": robots.task.task.title}
    if config is not None:
        lines |= {"Optimizer": config.optimizer.name, "Seed": str(config.seed)}
    generations = curves.get("fitness/best")
    if generations is not None and len(generations.generations):
        lines["Generations"] = f"{generations.generations[-1] + 1:,}"
    for name, tag in (("Evaluations", "evaluations"), ("Environment steps", "env_steps")):
        value = _last(curves, f"progress/{tag}")
        if value is not None:
            lines[name] = f"{value:,.0f}"
    seconds = sum(float(c.values.sum()) for tag, c in curves.items() if tag.startswith("time/"))
    if seconds > 0.0:
        lines["Computing time"] = duration(seconds)
    if robots.elites:
        statistics = robots.archive.statistics()
        possible = len(robots.archive.space.triples)
        lines |= {
            "Elites": f"{robots.elites:,} of {possible:,} measure triples "
            f"({statistics['filled_fraction']:.1%})",
            "QD score": f"{statistics['qd_score']:.4f}",
            "Best elite": f"{statistics['best']:.4f}",
            "Elites that succeed in at least half their episodes": f"{statistics['succeed']:,.0f}",
        }
    return lines


def setting_lines(values: Mapping[str, Any], prefix: str = "") -> dict[str, str]:
    """List the settings that are not null, by dotted name."""
    lines: dict[str, str] = {}
    for name, value in values.items():
        if isinstance(value, Mapping):
            lines |= setting_lines(value, f"{prefix}{name}.")
        elif value is not None:
            lines[prefix + name] = str(value)
    return lines


def charts(curves: Mapping[str, Curve]) -> list[dict[str, Any]]:
    """Collect the ``CHARTS`` for which there are curves."""
    drawn = []
    for title, names in CHARTS:
        lines = [
            {
                "name": name,
                "x": curves[tag].thinned().generations.tolist(),
                "y": np.round(curves[tag].thinned().values, 6).tolist(),
            }
            for tag, name in names.items()
            if tag in curves and len(curves[tag].values)
        ]
        if lines:
            drawn.append({"title": title, "lines": lines})
    return drawn


def world(settings: TaskSettings, scenarios: Sequence[Scenario]) -> dict[str, Any]:
    """Collect the constants and placements that the page needs to draw episodes."""
    task = settings.task
    return {
        "task": task.name,
        "title": task.title,
        "gridSize": settings.grid_size,
        "extent": playfield(settings.grid_size),
        "wallExtent": WALL_EXTENT,
        "successRadius": settings.radius,
        "distanceScore": settings.distance_score,
        "hasBall": task.has_ball,
        "lightRadius": LIGHT_RADIUS,
        "ballRadius": BALL_RADIUS,
        "targetSide": TARGET_SIDE,
        "cellSize": CELL_SIZE,
        "dt": DT,
        "steps": MAX_EPISODE_STEPS,
        "channels": nca_layout(task).channel_names,
        "cells": {
            character: {
                "code": int(cell),
                "name": task.cell_label(cell),
                "senses": cell in SENSOR_CELLS,
                "drives": cell is Cell.WHEEL,
            }
            for character, cell in CELL_CHARACTERS.items()
        },
        "palette": {name: f"rgb{color}" for name, color in _COLORS.items()},
        "scales": {"amount": canvas.AMOUNTS, "signed": canvas.SIGNED},
        "signedLimit": canvas.SIGNED_LIMIT,
        "scenarios": [_placements(scenario, settings.grid_size) for scenario in scenarios],
    }


def _placements(scenario: Scenario, grid_size: int) -> dict[str, Any]:
    quads = np.round(wall_quads(scenario, grid_size), _PLACEMENT_DECIMALS).tolist()
    return {
        "light": scenario.light,
        "target": scenario.target,
        "start": scenario.start,
        "walls": quads,
    }


def robot_table(robots: Robots) -> dict[str, Any]:
    """Tabulate numbers and bodies of all robots, unrounded, one list for each column."""
    space = robots.archive.space
    return {
        "elites": robots.elites,
        "eliteEpisodes": robots.elite_episodes,
        "champion": None if robots.champion is None else robots.elites,
        "championSource": None if robots.champion is None else robots.champion.source,
        "space": [space.min_sensors, space.min_wheels, space.max_cells],
        "measures": robots.measures.tolist(),
        "fitness": robots.fitness.tolist(),
        "success": robots.success.tolist(),
        "generation": robots.generations.tolist(),
        "body": [body_to_characters(body).replace("\n", "") for body in robots.bodies],
    }
