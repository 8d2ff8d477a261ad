"""Speed of the page of live robots in headless Chromium: ``python -m benchmarks.live``.

A robot that fills a grid drives while the page draws all that it shows. Frames are what the browser
draws in a second; work is the page's own time for one frame at true speed, of which 16.7 ms give 60
frames a second; and a step is the automaton and the physics alone. Times are medians.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.browser import resize, start_chromium
from ncrs.live.build import write_page
from ncrs.live.robots import live_robot
from ncrs.runs.robot import EvolvedRobot
from ncrs_envs.body import Cell
from ncrs_envs.tasks import TaskSettings

SIZES = (5, 9, 15)
SECONDS = 3.0
_TASK = "light_chase"
_SCRIPT = """
const [seconds, done] = arguments, { app } = NCRSLive, { session } = app;
app.play(false);
session.setBody(Int8Array.from(session.body.data, (_, i) => (i % 3 === 0 ? 4 : i % 3)));
session.phase = 'driving';
session.restart();
const timed = (number, work) => {
  const times = Array.from({ length: number }, () => {
    const start = performance.now();
    work();
    return performance.now() - start;
  });
  return times.sort((a, b) => a - b)[number >> 1];
};
timed(100, () => session.advance());
const step = timed(200, () => session.advance());
app.isRepeating = false;
app.isPlaying = true;
const work = timed(120, () => { app.advance(1 / 60); app.draw(1 / 60); });
let frames = 0;
const start = performance.now();
const count = (now) => {
  frames += 1;
  if (now - start < 1000 * seconds) requestAnimationFrame(count);
  else done([step, work, frames / ((now - start) / 1000), session.phase]);
};
requestAnimationFrame(count);
"""


class Speed(NamedTuple):
    """Result for one size of grid."""

    step_ms: float
    work_ms: float
    frames_per_second: float


def measure(driver: Any, grid_size: int, folder: Path) -> Speed:
    """Measure a robot on a full grid; its weights are random, which costs the same.

    Args:
        driver: Browser.
        grid_size: Side of the grid.
        folder: Folder for the page.
    """
    body = np.full((grid_size, grid_size), int(Cell.TISSUE), dtype=np.int8)
    body[0, :3] = [Cell.LIGHT_SENSOR, Cell.WHEEL, Cell.WHEEL]
    genome = np.random.default_rng(0).normal(scale=0.1, size=4572).astype(np.float32)
    settings = TaskSettings(_TASK, grid_size)
    robot = EvolvedRobot(genome, body, settings, np.nan, np.nan, name="full grid")
    page = write_page(folder / f"{grid_size}.html", [live_robot(robot)])
    driver.get(page.path.as_uri())
    driver.set_script_timeout(120)
    step, work, frames, _ = driver.execute_async_script(_SCRIPT, SECONDS)
    return Speed(step, work, frames)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES, help="sides of the grids")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        driver = start_chromium(Path(folder) / "profile")
        try:
            resize(driver, 1280, 900)
            print("cells    step      work per frame  frames per second")
            for size in options.sizes:
                speed = measure(driver, size, Path(folder))
                print(
                    f"{size:2} x {size:<2}  {speed.step_ms:5.2f} ms  {speed.work_ms:8.2f} ms  "
                    f"{speed.frames_per_second:12.1f}"
                )
        finally:
            driver.quit()


if __name__ == "__main__":
    main()
