"""Figures of robots: designs by task and method, NCA channels, last positions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Rectangle

from ncrs.runs.folders import Group, recipes_of, tasks_of
from ncrs.runs.robot import EvolvedRobot
from ncrs.viz.body_patches import add_body, add_silhouette, cell_legend
from ncrs.viz.recording import Recording, record_episodes
from ncrs.viz.style import COLORS, COLUMN, WIDTH, Plot, colormap, recipe_name
from ncrs_envs.body import body_to_characters
from ncrs_envs.canvas import SIGNED, SIGNED_LIMIT
from ncrs_envs.physics import TARGET_SIDE
from ncrs_envs.scenario import WALL_EXTENT
from ncrs_envs.tasks import REGIONS, get_task

_MOMENTS = ("seed", "end of growth", "end of control")


def designs_plot(groups: Sequence[Group]) -> Plot | None:
    """Draw the fittest champion of every group; None if there is none.

    Tasks down, methods and their variants across.
    """
    best = {(group.task, (group.method, group.variant)): group.champions()[:1] for group in groups}
    shown = [group for group in groups if best[group.task, (group.method, group.variant)]]
    if not shown:
        return None
    tasks, recipes = tasks_of(shown), recipes_of(shown)
    width, height = 1.75, 2.35
    figure = Figure(figsize=(max(COLUMN, width * len(recipes)), height * len(tasks) + 0.4))
    panels = figure.subplots(len(tasks), len(recipes), squeeze=False)
    rows: list[list[object]] = []
    seen = []
    for place, panel in np.ndenumerate(panels):
        task, recipe = tasks[place[0]], recipes[place[1]]
        if not best.get((task, recipe)):
            panel.set_axis_off()
            continue
        run, champion = best[task, recipe][0]
        sensors, wheels, cells = champion.measures
        add_body(panel, champion.body)
        panel.set_title(f"{get_task(task).title}, {recipe_name(*recipe)}")
        panel.set_xlabel(
            f"fitness {champion.fitness:.3f}, success {champion.success:.0%}\n"
            f"{cells} cells, {wheels} wheels, {sensors} sensors",
            fontsize=7,
        )
        seen.append(champion.body.ravel())
        drawn = body_to_characters(champion.body).replace("\n", "/")
        values = (champion.fitness, champion.success, sensors, wheels, cells, drawn)
        rows.append([task, *recipe, run.folder.name, run.config.seed, *values])
    handles = cell_legend(np.concatenate(seen), [get_task(task) for task in tasks])
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    columns = [
        "task", "method", "settings", "run", "seed", "fitness", "success", "sensors", "wheels",
        "cells", "body",
    ]  # fmt: skip
    return Plot("designs", figure, columns, rows)


def channels_plot(robot: EvolvedRobot, name: str, seed: int) -> Plot:
    """Draw all NCA channels at the seed, at the end of growth, and at the end of one episode."""
    growth = robot.growth()
    control = record_episodes(robot, 1, seed)[0].states[-1]
    states = np.stack([growth.states[0], growth.states[-1], control])
    colors = colormap(SIGNED)
    names = robot.nca.layout.channel_names
    figure = Figure(figsize=(WIDTH, 2.0))
    panels = figure.subplots(len(_MOMENTS), len(names) + 1)
    bodies = (growth.bodies[0], growth.bodies[-1], robot.body)
    for moment, (label, body) in enumerate(zip(_MOMENTS, bodies, strict=True)):
        add_body(panels[moment, 0], body)
        panels[moment, 0].set_ylabel(label.replace(" of ", "\nof "), fontsize=7)
        for channel, channel_name in enumerate(names):
            panel = panels[moment, channel + 1]
            values = states[moment, :, :, channel]
            image = panel.imshow(values, cmap=colors, vmin=-SIGNED_LIMIT, vmax=SIGNED_LIMIT)
            panel.set(xticks=[], yticks=[])
            panel.spines[:].set(visible=True, color="#909090")
            if moment == 0:
                panel.set_title(channel_name.replace(" ", "\n").replace("/", "/\n"), fontsize=6)
    panels[0, 0].set_title("robot", fontsize=6)
    bar = figure.colorbar(image, ax=panels, shrink=0.8, aspect=30, pad=0.01, extend="both")
    bar.ax.tick_params(labelsize=6)
    rows = [
        [_MOMENTS[moment], names[channel], row, column, value]
        for (moment, row, column, channel), value in np.ndenumerate(states)
    ]
    return Plot(f"channels_{name}", figure, ["moment", "channel", "row", "column", "value"], rows)


def positions_plot(robot: EvolvedRobot, name: str, episodes: int, seed: int) -> Plot:
    """Draw positions at the end of several episodes, the paths there, and the goals."""
    recordings = record_episodes(robot, episodes, seed)
    figure = Figure(figsize=(COLUMN, COLUMN + 0.45))
    panel = figure.subplots()
    rows = []
    for index, recording in enumerate(recordings):
        color = COLORS[index % REGIONS]
        last = recording.scenes[-1]
        panel.plot(*last.path.T, color=color, lw=0.5, zorder=1)
        _add_goal(panel, recording, color)
        add_silhouette(panel, robot.body, last.pose, color)
        goal = last.target if last.light is None else last.light
        assert goal is not None
        values = (*last.pose, *goal, *(last.ball or ("", "")), recording.fitness)
        rows.append([index, index % REGIONS, *values, int(recording.success)])
    reach = WALL_EXTENT * recordings[0].scenes[0].extent
    panel.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xlabel="x", ylabel="y")
    solved = sum(recording.success for recording in recordings)
    method = f"{robot.task.task.title}: {solved} of {episodes} episodes solved"
    panel.set_title(method)
    figure.legend(handles=_position_legend(recordings[0]), loc="outside lower center", ncols=3)
    columns = [
        "episode", "region", "x", "y", "angle_rad", "goal_x", "goal_y", "ball_x", "ball_y",
        "fitness", "success",
    ]  # fmt: skip
    return Plot(f"positions_{name}", figure, columns, rows)


def _add_goal(panel: Axes, recording: Recording, color: str) -> None:
    last = recording.scenes[-1]
    panel.plot(*recording.scenario.start, marker="+", color=color, ms=5, mew=0.8, ls="")
    if last.light is not None:
        panel.plot(*last.light, marker="*", color=color, mec="black", mew=0.4, ms=7, ls="")
        ring = Circle(last.light, last.success_radius, fc="none", ec=color, lw=0.4, ls=":")
        panel.add_patch(ring)
    if last.target is not None:
        x, y = last.target
        corner = (x - TARGET_SIDE / 2.0, y - TARGET_SIDE / 2.0)
        panel.add_patch(Rectangle(corner, TARGET_SIDE, TARGET_SIDE, fc="none", ec="black", lw=0.6))
    if last.ball is not None:
        panel.plot(*last.ball, marker="o", color=color, mec="black", mew=0.4, ms=4, ls="")


def _position_legend(recording: Recording) -> list[Line2D]:
    scene = recording.scenes[0]
    gray: dict[str, Any] = {"color": "#808080", "ls": ""}
    handles = [
        Line2D([], [], marker="s", ms=6, label="robot at the end", **gray),
        Line2D([], [], marker="+", label="start", **gray),
    ]
    if scene.light is not None:
        handles.append(Line2D([], [], marker="*", mec="black", mew=0.4, label="light", **gray))
    if scene.ball is not None:
        handles.append(Line2D([], [], marker="o", ms=4, label="ball at the end", **gray))
    if scene.target is not None:
        handles.append(Line2D([], [], marker="s", mfc="none", mec="black", ls="", label="target"))
    return handles
