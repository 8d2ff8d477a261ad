"""Limits of success in the tasks: ``python -m benchmarks.bounds``.

The first is the fraction of scenarios in which the way is short enough for a robot that drives as
fast as wheels can. A wheel's force vanishes at ``MAX_SPEED``. The estimate ignores turning and
collisions, and lets the robot touch the ball with its far corner, so it is generous; but a ball
that is flung rather than pushed may be faster.

The second is the success in Obstacle of hand-made robots that know more than sensors tell: the
positions of the light and of the passage. The last of them knows only what its single sensor tells,
which is how fast the light comes nearer, but not on which side it is. All drive on the batched
simulator.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass

import gymnasium
import numpy as np
from numpy.typing import NDArray

from benchmarks.parity import passage
from ncrs_envs.body import CELL_SIZE, DEFAULT_GRID_SIZE, Cell, cell_centers, parse_body
from ncrs_envs.physics import BALL_RADIUS, DT, WHEEL_FORWARD_FRICTION, WHEEL_THRUST
from ncrs_envs.scenario import Scenario, sample_scenarios
from ncrs_envs.tasks import MAX_EPISODE_STEPS, TASKS, get_task, playfield

MAX_SPEED = WHEEL_THRUST / WHEEL_FORWARD_FRICTION
"""Maximum speed of a wheel in units per second."""
REACH = MAX_SPEED * DT * MAX_EPISODE_STEPS
"""Maximum way of a robot in an episode, in units."""

SLIDER = ["..L..", ".....", "..W..", ".WWW.", "..W.."]
"""Body three cells wide: a nose that slides along walls, and wheels close together to turn fast."""
TOUCH_SLIDER = ["..L..", "..C..", "..W..", ".WWW.", ".WWW."]
"""The same with a touch sensor, for the courses in which one is needed."""
TWO_SIDED = ["..C..", "..W..", ".LWL.", ".WWW.", ".WWW."]
"""Body with a touch sensor whose light sensors can tell left from right."""
NIMBLE = ["..L..", ".....", "..W..", ".WWW.", "....."]
"""Body that turns fastest: four wheels, apart from the sensor at its nose."""
GAIN = 4.0
"""Gain of the steering, in gas per radian."""
NEAR = 47.5
"""Distance to the light from which the robot with one sensor steers, in units."""
ONE_EYED_GAIN = 5.0
"""Gain of its steering, in gas per radian."""
TOLERATED = 1.0
"""Bearing up to which it drives straight on, in radians: the light still comes nearer then."""
WORSE = 0.02
"""Loss of approach within a step after which it turns the other way, in units."""
BEFORE_EXIT = 3.0
"""Distance below the walls' end from which a robot counts as through, in units."""


@dataclass(frozen=True)
class Driver:
    """Knowledge that a robot is steered by."""

    name: str
    knows_passage: bool
    knows_light: bool


DRIVERS = (
    Driver("straight on", False, False),
    Driver("straight on, to the light once through", False, True),
    Driver("to the passage, straight on", True, False),
    Driver("to the passage, to the light once through", True, True),
)


def way(scenario: Scenario, success_radius: float) -> float:
    """Measure the shortest way in units: of the robot, or of the robot and then the ball."""
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


def steered(turn: NDArray[np.float64]) -> NDArray[np.float32]:
    """Drive at full throttle, with less or reverse gas on the side to turn to.

    Args:
        turn: Difference in gas, ``(N,)``, positive anticlockwise; 2 turns on the spot.

    Returns:
        Actions, float32 ``(N, n, n)``.
    """
    side = np.sign(cell_centers(DEFAULT_GRID_SIZE)[..., 0])
    return np.clip(1.0 + side * turn[:, None, None], -1.0, 1.0).astype(np.float32)


def driven(
    driver: Driver,
    scenarios: list[Scenario],
    body: list[str] = SLIDER,
    task: str = "obstacle",
) -> tuple[float, float]:
    """Drive a body through courses; returns the fractions that succeed, and that cross."""
    exits = np.array([passage(scenario) for scenario in scenarios])
    lights = np.array([scenario.light for scenario in scenarios])
    envs = gymnasium.make_vec(TASKS[task].env_id, num_envs=len(scenarios))
    _, infos = envs.reset(options={"body": body, "scenario": scenarios})
    through = np.zeros(len(scenarios), dtype=bool)
    for _ in range(MAX_EPISODE_STEPS):
        x, y, angle = infos["pose"].T
        through |= y > exits[:, 1] - BEFORE_EXIT
        known = np.where(through, driver.knows_light, driver.knows_passage)
        goals = np.where(through[:, None], lights, exits + (0.0, BEFORE_EXIT))
        bearing = np.arctan2(x - goals[:, 0], goals[:, 1] - y)
        error = np.remainder(bearing - angle + math.pi, 2.0 * math.pi) - math.pi
        *_, infos = envs.step(steered(np.where(known, GAIN * error, 0.0)))
    envs.close()
    return float(infos["success"].mean()), float(infos["crossed"].mean())


def one_eyed(scenarios: list[Scenario]) -> tuple[float, float]:
    """Steer ``NIMBLE`` through Obstacle by its own sensor; returns the same fractions."""
    task = TASKS["obstacle"]
    extent = playfield(DEFAULT_GRID_SIZE)
    envs = gymnasium.make_vec(task.env_id, num_envs=len(scenarios))
    cells, _ = envs.reset(options={"body": NIMBLE, "scenario": scenarios})
    row, column = np.argwhere(parse_body(NIMBLE) == Cell.LIGHT_SENSOR)[0]
    side = np.ones(len(scenarios))
    before = -extent * np.log(cells[:, row, column])
    approach = np.zeros(len(scenarios))
    for _ in range(MAX_EPISODE_STEPS):
        distance = -extent * np.log(cells[:, row, column])
        last, approach = approach, before - distance
        side = np.where(last - approach > WORSE, -side, side)
        # At full speed the robot covers a unit a step: the bearing but for its sign.
        bearing = np.arccos(np.clip(approach, -1.0, 1.0))
        turn = side * ONE_EYED_GAIN * np.maximum(bearing - TOLERATED, 0.0)
        cells, *_, infos = envs.step(steered(np.where(distance < NEAR, turn, 0.0)))
        before = distance
    envs.close()
    return float(infos["success"].mean()), float(infos["crossed"].mean())


def main() -> None:
    """Print the fraction of short enough scenarios in each task, and the success of each driver."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scenarios", type=int, default=4000, help="default: %(default)s")
    count = parser.parse_args().scenarios
    scenarios = {
        name: sample_scenarios(name, 0, count) for name in ("light_chase", "obstacle", "carry_ball")
    }
    for name, drawn in scenarios.items():
        ways = [way(one, get_task(name).success_radius) for one in drawn]
        possible = sum(length <= REACH for length in ways) / count
        print(f"{name:<12} {possible:.0%} of the scenarios are short enough")
    for task, body in (
        ("obstacle", SLIDER),
        ("obstacle", NIMBLE),
        ("obstacle_touch", TOUCH_SLIDER),
        ("obstacle_touch", TWO_SIDED),
    ):
        print(f"{task}, {'/'.join(body)}:")
        for driver in DRIVERS:
            success, crossed = driven(driver, scenarios["obstacle"], body, task)
            print(f"  {driver.name}: {success:.0%} succeed, {crossed:.0%} cross")
        if body is NIMBLE:
            success, crossed = one_eyed(scenarios["obstacle"])
            print(f"  by its sensor, once near: {success:.0%} succeed, {crossed:.0%} cross")


if __name__ == "__main__":
    main()
