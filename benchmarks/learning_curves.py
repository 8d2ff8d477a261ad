"""Learning curves of the examples: runs each with several seeds, and draws success over time.

    python -m benchmarks.learning_curves run FOLDER [--seeds 0 1 2] [--examples ppo ...]
    python -m benchmarks.learning_curves draw FOLDER assets/learning_curves.png

Running writes FOLDER/EXAMPLE-SEED.csv and the last line that the example printed, its test; it
skips what is there. Only one example runs at a time, so that its seconds mean something.
"""

from __future__ import annotations

import argparse
import csv
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ncrs.runs.checkpoint import write_atomically
from ncrs.viz.style import COLORS, LINES, WIDTH, style

ROOT = Path(__file__).parents[1]
EXAMPLES = {
    "ppo": ("PPO, LightChase", ["ppo.py"]),
    "ppo_carry_ball": ("recurrent PPO, CarryBall", ["ppo.py", "--task", "carry_ball"]),
    "ppo_obstacle": ("recurrent PPO, Obstacle", ["ppo.py", "--task", "obstacle"]),
    "sb3_many": ("SB3's PPO, 256 environments", ["sb3_ppo.py"]),
    "sb3_one": (
        "SB3's PPO, one environment",
        ["sb3_ppo.py", "--envs", "1", "--steps", "200000"],
    ),
    "body_conditioned": ("PPO, many bodies", ["body_conditioned.py"]),
}
"""Name for the legend, and the command, of each example that has a curve of success."""


def run(folder: Path, names: Sequence[str], seeds: Sequence[int]) -> None:
    """Run examples one after another."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        script, *arguments = EXAMPLES[name][1]
        for seed in seeds:
            curve = folder / f"{name}-{seed}.csv"
            if curve.exists():
                continue
            command = [sys.executable, str(ROOT / "examples" / script), *arguments]
            command += ["--seed", str(seed), "--curve", str(curve)]
            done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
            last = done.stdout.splitlines()[-1]
            (folder / f"{name}-{seed}.txt").write_text(last + "\n")
            print(f"{name}, seed {seed}: {last}", flush=True)


def read(curve: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Read seconds and success of a curve."""
    with curve.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    return tuple(  # type: ignore[return-value]
        np.array([float(row[column]) for row in rows]) for column in ("seconds", "success")
    )


def draw(folder: Path, picture: Path) -> None:
    """Draw the median of the seeds and their range."""
    with style():
        figure = Figure(figsize=(WIDTH, 3.0))
        panel = figure.subplots()
        for index, (name, (label, _)) in enumerate(EXAMPLES.items()):
            curves = [read(path) for path in sorted(folder.glob(f"{name}-*.csv"))]
            if not curves:
                continue
            count = min(len(success) for _, success in curves)
            seconds = np.median([times[:count] for times, _ in curves], axis=0)
            success = np.array([values[:count] for _, values in curves])
            color = COLORS[index % len(COLORS)]
            panel.plot(
                seconds, np.median(success, axis=0), color=color, ls=LINES[index % len(LINES)],
                label=f"{label} ({len(curves)} seed{'s' if len(curves) > 1 else ''})",
            )  # fmt: skip
            if len(curves) > 1:
                low, high = success.min(axis=0), success.max(axis=0)
                panel.fill_between(seconds, low, high, color=color, alpha=0.2, lw=0)
        panel.set(xscale="log", ylim=(-0.02, 1.02), xlabel="seconds on two cores")
        panel.set_ylabel("success while exploring (median, range)")
        figure.legend(loc="outside right center")
        write_atomically(picture, lambda stream: figure.savefig(stream, dpi=150, format="png"))


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    running = commands.add_parser("run", help="run examples and keep their curves")
    running.add_argument("folder", type=Path)
    running.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    running.add_argument("--examples", nargs="+", choices=EXAMPLES, default=list(EXAMPLES))
    drawing = commands.add_parser("draw", help="draw the curves in a folder")
    drawing.add_argument("folder", type=Path)
    drawing.add_argument("picture", type=Path)
    options = parser.parse_args()
    if options.command == "run":
        run(options.folder, options.examples, options.seeds)
    else:
        draw(options.folder, options.picture)


if __name__ == "__main__":
    main()
