"""Figures of the best fitness by generation: median and range of the seeds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ncrs.runs.folders import Group, tasks_of
from ncrs.viz.options import AXES
from ncrs.viz.style import COLUMN, WIDTH, Plot, recipe_name, recipe_styles
from ncrs_envs.tasks import get_task

_BEST = "fitness/best"


def fitness_curves(group: Group, axis: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Read the best fitness of a group's runs, as far as all of them have come.

    Returns:
        Values of the axis, ``(T,)``, and best fitness, ``(runs, T)``; no runs if none has a table.
    """
    tables = [table for table in (run.metrics() for run in group.runs) if table is not None]
    if not tables:
        return np.empty(0), np.empty((0, 0))
    common = min(len(table[_BEST]) for table in tables)
    return tables[0][AXES[axis]][:common], np.stack([table[_BEST][:common] for table in tables])


def fitness_plot(groups: Sequence[Group], axis: str) -> Plot | None:
    """Plot best fitness; None if no run has a table of its curves.

    One panel per task, one line per method and variant of its settings.

    Args:
        groups: Groups to compare.
        axis: One of ``AXES``; "evaluations" is fair if the methods' populations differ.
    """
    curves = {group.name: fitness_curves(group, axis) for group in groups}
    shown = [group for group in groups if len(curves[group.name][1])]
    if not shown:
        return None
    tasks = tasks_of(shown)
    figure = Figure(figsize=(min(WIDTH, COLUMN * len(tasks)), 2.8))
    panels = figure.subplots(1, len(tasks), squeeze=False)[0]
    looks = recipe_styles(shown)
    rows: list[list[object]] = []
    for group in shown:
        x, best = curves[group.name]
        median, low, high = np.median(best, axis=0), best.min(axis=0), best.max(axis=0)
        look = looks[group.method, group.variant]
        panel = panels[tasks.index(group.task)]
        seeds = len(best)
        label = (
            f"{recipe_name(group.method, group.variant)} ({seeds} seed{'s' if seeds > 1 else ''})"
        )
        panel.plot(x, median, **look, label=label)
        if seeds > 1:
            panel.fill_between(x, low, high, color=look["color"], alpha=0.2, lw=0)
        rows += [
            [group.task, group.method, group.variant, *values]
            for values in zip(x, median, low, high, [seeds] * len(x), strict=True)
        ]
    for task, panel in zip(tasks, panels, strict=True):
        panel.set(title=get_task(task).title, xlabel=axis)
        panel.xaxis.get_major_locator().set_params(integer=True)
        # Below the panel: curves may run anywhere in it.
        panel.legend(loc="upper left", bbox_to_anchor=(0.0, -0.22), borderaxespad=0.0)
    panels[0].set_ylabel("best fitness (median, range)")
    columns = ["task", "method", "settings", axis, "median", "lowest", "highest", "seeds"]
    return Plot("fitness", figure, columns, rows)
