"""A report's summary of the run, and the table of its robots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ncrs.report.curves import Curve
from ncrs.report.robots import Robots
from ncrs.runs.settings import TrainConfig
from ncrs.runs.wording import duration
from ncrs_envs.body import body_to_characters
from ncrs_envs.tasks import Task

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
