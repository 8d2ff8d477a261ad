"""All figures of one run, or of a comparison of several."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from ncrs.runs.elites import EliteArchive
from ncrs.runs.folders import Group, find_runs, group_runs
from ncrs.viz.errors import VizError
from ncrs.viz.figures_archive import archive_plot, fitness_range, histogram_plot
from ncrs.viz.figures_curves import fitness_plot
from ncrs.viz.figures_robots import channels_plot, designs_plot, positions_plot
from ncrs.viz.options import FigureOptions
from ncrs.viz.style import Plot, style

_COMPARISONS, _OF_A_GROUP = 3, 3


def _plots(groups: Sequence[Group], options: FigureOptions) -> Iterator[Plot | None]:
    """Draw ``_COMPARISONS`` figures and ``_OF_A_GROUP`` of each; None without data for one."""
    yield fitness_plot(groups, options.axis)
    yield designs_plot(groups)
    yield histogram_plot(groups)
    archives = {group.name: archive for group in groups if (archive := _fullest(group))}
    for group in groups:
        champions = group.champions()
        if champions:
            _, champion = champions[0]
            yield channels_plot(champion, group.name, options.seed)
            yield positions_plot(champion, group.name, options.episodes, options.seed)
        else:
            yield from (None, None)
        if group.name in archives:
            archive = archives[group.name]
            # One range for all methods, so that the colours of their figures compare.
            alike = [other for other in archives.values() if other.task.name == group.task]
            yield archive_plot(archive, group.name, fitness_range(alike))
        else:
            yield None


def _fullest(group: Group) -> EliteArchive | None:
    """Return the archive with the most elites; None if no run has elites."""
    archives = [archive for archive in (run.archive() for run in group.runs) if archive]
    return max(archives, key=lambda found: len(found.archive), default=None)


def save_figures(
    paths: Sequence[Path],
    folder: Path,
    options: FigureOptions | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Path]:
    """Draw all figures that the runs have data for, and write them into a folder.

    Args:
        paths: Folders of runs, or of sweeps; runs are grouped by all settings but the seed.
        folder: Folder to write to, made if missing.
        options: Axis and episodes; None for the defaults.
        progress: Function to call with the number of figures done, and the number of all.

    Returns:
        Paths of all files: PNG, SVG and CSV of each figure.

    Raises:
        ConfigError: If there is no run.
        VizError: If there is nothing to show yet.
        ScenarioError: If the number of episodes is not a positive integer.
    """
    options = FigureOptions() if options is None else options
    groups = group_runs(find_runs(paths))
    total = _COMPARISONS + _OF_A_GROUP * len(groups)
    saved: list[Path] = []
    with style():
        for done, plot in enumerate(_plots(groups, options), start=1):
            if plot is not None:
                saved += plot.save(folder)
            if progress is not None:
                progress(done, total)
    if not saved:
        raise VizError(
            f"Nothing to draw yet: {', '.join(map(str, paths))} has no champion, no archive and no "
            "curves."
        )
    return saved
