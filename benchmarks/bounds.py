"""In how many scenarios the way is short enough for a robot that drives as fast as wheels can.

    python -m benchmarks.bounds

A wheel's force vanishes at ``MAX_SPEED``. The estimate ignores turning and collisions, and lets the
robot touch the ball with its far corner, so it is generous; but a ball that is flung rather than
pushed may be faster.
"""

from __future__ import annotations

import argparse
import math

import numpy as np

from ncrs_envs.body import CELL_SIZE, DEFAULT_GRID_SIZE
from ncrs_envs.physics import BALL_RADIUS, DT, WHEEL_FORWARD_FRICTION, WHEEL_THRUST
from ncrs_envs.scenario import Scenario, sample_scenarios
from ncrs_envs.tasks import MAX_EPISODE_STEPS, get_task

MAX_SPEED = WHEEL_THRUST / WHEEL_FORWARD_FRICTION
"""Units per second."""
REACH = MAX_SPEED * DT * MAX_EPISODE_STEPS
"""Units in an episode."""


def way(scenario: Scenario, success_radius: float) -> float:
    """Shortest way in units: of the robot's centre, or of the robot and then the ball."""
    if scenario.ball is not None and scenario.target is not None:
        corner = math.hypot(1.0, 1.0) * DEFAULT_GRID_SIZE * CELL_SIZE / 2.0
        to_ball = max(0.0, math.dist(scenario.start, scenario.ball) - corner - BALL_RADIUS)
        return to_ball + math.dist(scenario.ball, scenario.target) - success_radius
    assert scenario.light is not None
    if scenario.walls is None:
        return math.dist(scenario.start, scenario.light) - success_radius
    # Straight to some point of the passage, and straight on.
    (left, top), (right, _) = (line[-1] for line in scenario.walls)
    return min(
        math.dist(scenario.start, (x, top))
        + max(0.0, math.dist((x, top), scenario.light) - success_radius)
        for x in np.linspace(left, right, 21)
    )


def main() -> None:
    """Print the share of scenarios that are short enough, for each task."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scenarios", type=int, default=4000, help="default: %(default)s")
    count = parser.parse_args().scenarios
    for name in ("light_chase", "obstacle", "carry_ball"):
        task = get_task(name)
        ways = [way(one, task.success_radius) for one in sample_scenarios(task, 0, count)]
        possible = sum(length <= REACH for length in ways) / count
        print(f"{name:<12} {possible:.0%} of the scenarios are short enough")


if __name__ == "__main__":
    main()
