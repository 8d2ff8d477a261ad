"""Success of the LightChase champions under damage, sensor noise and failing wheels.

    python -m benchmarks.robustness measure FILE.json [--episodes 400] [--seeds 0 1 2 3 4]
    python -m benchmarks.robustness table FILE.json
    python -m benchmarks.robustness draw FILE.json assets/robustness.png

Damage and failures strike at a random step of the first half. Measuring writes every point at once,
and skips those that are there.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ncrs.automaton.regrow_to import REPAIR_STEPS
from ncrs.runs.assessment import assess
from ncrs.runs.checkpoint import write_json
from ncrs.runs.published import load_champion
from ncrs.runs.statistics import wilson_interval
from ncrs.viz.style import COLORS, LINES, WIDTH, style
from ncrs_envs.perturbing import PerturbationSettings
from ncrs_envs.tasks import MAX_EPISODE_STEPS

HALF = MAX_EPISODE_STEPS // 2
TASK = "light_chase"
REPAIRER = f"{TASK}/repair"
ROBOTS = tuple(f"{TASK}/{name}" for name in ("best", "cma_es", "curriculum", "robust", "repair"))
AXES = {
    "damage": ("modules lost", (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)),
    "failure": ("wheels that fail", (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)),
    "noise": ("noise of the sensors", (0.0, 0.001, 0.003, 0.01, 0.03, 0.1)),
}
"""Label and values of what is varied, by name."""


def perturbations_of(robot: str, axis: str, value: float) -> PerturbationSettings:
    """Return the perturbations of a point; the repairer repairs itself after damage."""
    settings = {
        "damage": PerturbationSettings(damage_fraction=value, damage_until=HALF),
        "failure": PerturbationSettings(failure_fraction=value, failure_until=HALF),
        "noise": PerturbationSettings(sensor_noise=value),
    }[axis]
    return replace(settings, repair_steps=REPAIR_STEPS) if robot == REPAIRER else settings


def points(axes: Sequence[str]) -> Iterator[tuple[str, str, float]]:
    """List robot, axis and value of all points of some axes."""
    for axis in axes:
        for robot in ROBOTS:
            yield from ((robot, axis, value) for value in AXES[axis][1])


def measure(file: Path, axes: Sequence[str], episodes: int, seeds: Sequence[int]) -> None:
    """Measure what is missing in a file, with the batched engine."""
    found: dict[str, Any] = json.loads(file.read_text()) if file.is_file() else {}
    for robot, axis, value in points(axes):
        name = f"{robot} {axis} {value:g}"
        if name in found:
            continue
        tests = [
            assess(
                load_champion(robot),
                episodes=episodes,
                seed=seed,
                engine="batched",
                perturbations=perturbations_of(robot, axis, value),
            )
            for seed in seeds
        ]
        found[name] = {
            "successes": [test.success.count for test in tests],
            "episodes": episodes,
            "recovered": None if tests[0].recovered is None else [t.recovered for t in tests],
            "fitness": [test.fitness for test in tests],
        }
        write_json(file, found)
        print(f"{name}: {sum(found[name]['successes']) / (episodes * len(seeds)):.1%}", flush=True)


def _interval(point: dict[str, Any]) -> tuple[float, float, float]:
    """Return the fraction of success over all seeds, and its 95 % interval."""
    count, total = sum(point["successes"]), point["episodes"] * len(point["successes"])
    return count / total, *wilson_interval(count, total)


def table(file: Path) -> None:
    """Print a table for each axis, and one of the modules that came back."""
    found = json.loads(file.read_text())
    for axis, (label, values) in AXES.items():
        print(f"\n| {label} | " + " | ".join(f"{value:g}" for value in values) + " |")
        print("|---" * (len(values) + 1) + "|")
        for robot in ROBOTS:
            cells = []
            for value in values:
                fraction, low, high = _interval(found[f"{robot} {axis} {value:g}"])
                cells.append(f"{fraction:.0%} ({low:.0%} to {high:.0%})")
            print(f"| `{robot}` | " + " | ".join(cells) + " |")
    back = [found[f"{REPAIRER} damage {value:g}"]["recovered"] for value in AXES["damage"][1][1:]]
    print("\nModules that came back: " + ", ".join(f"{np.mean(values):.1%}" for values in back))


def draw(file: Path, picture: Path) -> None:
    """Draw success against each axis, with the 95 % intervals over all seeds."""
    found = json.loads(file.read_text())
    with style():
        figure = Figure(figsize=(WIDTH, 2.4))
        panels = figure.subplots(1, len(AXES), sharey=True, squeeze=False)[0]
        for panel, (axis, (label, values)) in zip(panels, AXES.items(), strict=True):
            places = np.arange(len(values))
            for index, robot in enumerate(ROBOTS):
                rows = [_interval(found[f"{robot} {axis} {value:g}"]) for value in values]
                middle, low, high = np.array(rows).T
                color = COLORS[index]
                panel.plot(places, middle, color=color, ls=LINES[index], label=robot)
                panel.fill_between(places, low, high, color=color, alpha=0.2, lw=0)
            texts = [f"{value:g}" if axis == "noise" else f"{value:.0%}" for value in values]
            panel.set_xticks(places, texts)
            panel.set_xlabel(label)
            panel.set_ylim(0.0, 1.02)
        panels[0].set_ylabel("success")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(ROBOTS))
        figure.savefig(picture, metadata={"Software": None})
    print(f"Saved {picture}")


def main() -> None:
    """Measure, or show what was measured."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("action", choices=("measure", "table", "draw"))
    parser.add_argument("file", type=Path)
    parser.add_argument("picture", type=Path, nargs="?")
    parser.add_argument("--episodes", type=int, default=400)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2, 3, 4])
    parser.add_argument("--axes", choices=tuple(AXES), nargs="+", default=list(AXES))
    options = parser.parse_args()
    if options.action == "measure":
        measure(options.file, options.axes, options.episodes, options.seeds)
    elif options.action == "table":
        table(options.file)
    elif options.picture is None:
        parser.error("draw needs the picture's path")
    else:
        draw(options.file, options.picture)


if __name__ == "__main__":
    main()
