"""Figures of archives: panels of sensors x wheels, and histograms of fitness."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure

from ncrs.runs.elites import EliteArchive
from ncrs.runs.folders import Group, tasks_of
from ncrs.viz.archive_grid import archive_grid
from ncrs.viz.style import (
    COLUMN,
    EMPTY_CELL,
    WIDTH,
    Plot,
    colormap,
    recipe_name,
    recipe_styles,
)
from ncrs_envs.canvas import AMOUNTS
from ncrs_envs.tasks import get_task

_COLUMNS = 6
_BINS = 30


def fitness_range(archives: Sequence[EliteArchive]) -> tuple[float, float]:
    """Return the lowest and the highest fitness of the elites of all archives."""
    fitness = np.concatenate([elites.archive.column("fitness") for elites in archives])
    return float(fitness.min()), float(fitness.max())


def archive_plot(elites: EliteArchive, name: str, limits: tuple[float, float]) -> Plot:
    """Plot an archive's fitness: a panel per number of cells, sensors across and wheels up.

    Gray cells are possible and empty.

    Args:
        elites: Archive with at least one elite.
        name: Name of the figure's files.
        limits: Fitness at the lower and at the upper end of the colour scale.
    """
    archive = elites.archive
    measures, fitness = archive.measures, archive.column("fitness")
    grid = archive_grid(measures, fitness, archive.space.triples)
    colors = colormap(AMOUNTS)
    norm = Normalize(*limits)
    rows = math.ceil(len(grid.cells) / _COLUMNS)
    figure = Figure(figsize=(WIDTH, WIDTH / _COLUMNS * rows * 1.05))
    panels = figure.subplots(rows, _COLUMNS, sharex=True, sharey=True, squeeze=False)
    side = max(grid.values.shape[1:])
    for index, panel in enumerate(panels.ravel()):
        if index >= len(grid.cells):
            panel.set_axis_off()
            continue
        empty = np.where(grid.possible[index], 1.0, np.nan).T
        panel.imshow(empty, cmap=ListedColormap([EMPTY_CELL]), origin="lower", vmin=0, vmax=1)
        image = panel.imshow(grid.values[index].T, cmap=colors, norm=norm, origin="lower")
        panel.set_title(f"{grid.cells[index]} cells", pad=2, fontsize=7)
        ticks = list(range(0, side, 10))
        panel.set(xticks=ticks, yticks=ticks, xlim=(-0.5, side - 0.5), ylim=(-0.5, side - 0.5))
    figure.supxlabel("sensors", fontsize=8)
    figure.supylabel("wheels", fontsize=8)
    possible = len(archive.space.triples)
    title = f"{elites.task.task.title}: {len(archive)} of {possible} elites"
    figure.suptitle(f"{title}, QD-score {fitness.sum() / possible:.3f}", fontsize=8)
    figure.colorbar(image, ax=panels, label="fitness", shrink=0.6, aspect=30)
    columns = ["sensors", "wheels", "cells", "fitness", "success"]
    data = zip(measures.tolist(), fitness, archive.column("success"), strict=True)
    return Plot(
        f"archive_{name}", figure, columns, [[*triple, *values] for triple, *values in data]
    )


def histogram_plot(groups: Sequence[Group]) -> Plot | None:
    """Plot a histogram of the elites' fitness; None if no run has elites.

    One panel per task, one line per method and variant: the mean of its runs.
    """
    found = {
        group.name: [
            archive.archive.column("fitness")
            for archive in (run.archive() for run in group.runs)
            if archive is not None
        ]
        for group in groups
    }
    shown = [group for group in groups if found[group.name]]
    if not shown:
        return None
    tasks, looks = tasks_of(shown), recipe_styles(shown)
    figure = Figure(figsize=(min(WIDTH, COLUMN * len(tasks)), 2.5))
    panels = figure.subplots(1, len(tasks), squeeze=False)[0]
    rows: list[list[object]] = []
    for task, panel in zip(tasks, panels, strict=True):
        members = [group for group in shown if group.task == task]
        every = np.concatenate([values for group in members for values in found[group.name]])
        edges = np.histogram_bin_edges(every, _BINS)
        for group in members:
            runs = found[group.name]
            counts = np.mean([np.histogram(values, edges)[0] for values in runs], axis=0)
            panel.stairs(
                counts,
                edges,
                **looks[group.method, group.variant],
                lw=1.2,
                label=f"{recipe_name(group.method, group.variant)} ({counts.sum():.0f} elites)",
            )
            rows += [
                [task, group.method, group.variant, low, high, count, len(runs)]
                for low, high, count in zip(edges[:-1], edges[1:], counts, strict=True)
            ]
        panel.set(title=get_task(task).title, xlabel="fitness of the elite")
        panel.legend(loc="upper left")
    panels[0].set_ylabel("elites per run")
    columns = ["task", "method", "settings", "from", "to", "elites_per_run", "runs"]
    return Plot("archive_histogram", figure, columns, rows)
