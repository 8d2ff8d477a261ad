"""Baselines by simple controllers, through ``gymnasium.make``: ``python examples/baselines.py``.

Controllers on hand-made bodies, 100 episodes each on Box2D: random actions, full throttle, and a
Braitenberg vehicle, which slows down the wheels on the side of the sensor that sees more light. In
CarryBall it chases the ball; another controller does so until the ball lies between the prongs at
the robot's front, and then steers by the target. In Obstacle a narrow body that evolution found, an
arrow, is driven at full throttle: the walls guide it to the passage, and it succeeds more often
than the vehicle that steers. A robot that stands still earns 0.427 in LightChase.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import gymnasium
import numpy as np
from numpy.typing import NDArray

import ncrs_envs
from ncrs.runs.assessment import Proportion

Grid = NDArray[np.float32]
Controller = Callable[[Grid], Grid]
Cell = tuple[int, int]

# Light bodies turn fast. Only three cells wide fit through the passage of Obstacle.
BODIES = {
    "light_chase": [".....", "LWWWL", "WWWWW", "WWWWW", "....."],
    "obstacle": [".....", ".LWL.", ".WWW.", ".WWW.", "....."],
    "carry_ball": ["T...T", "WWWWW", "WWWWW", "WLWLW", "....."],
}
ARROW = ["..W..", "..L..", "..W..", "..W..", ".WWW."]
GAIN = {"light_chase": 80.0, "obstacle": 320.0, "carry_ball": 120.0}
CARRYING_GAIN = 40.0
CAUGHT = 0.82
"""Mean value of the outermost ball sensors when the ball lies between the prongs."""


def random_actions(seed: int) -> Controller:
    """Drive every wheel at random in every step."""
    rng = np.random.default_rng(seed)
    return lambda observation: rng.uniform(-1, 1, observation.shape).astype(np.float32)


def full_throttle(observation: Grid) -> Grid:
    """Drive all wheels forward."""
    return np.ones_like(observation)


def outermost(body: NDArray[np.int8], kind: ncrs_envs.Cell) -> tuple[Cell, Cell]:
    """Find the leftmost and the rightmost sensor of a kind."""
    sensors = np.argwhere(body == kind)
    left, right = sensors[sensors[:, 1].argmin()], sensors[sensors[:, 1].argmax()]
    return (int(left[0]), int(left[1])), (int(right[0]), int(right[1]))


def throttle(shape: tuple[int, ...], turn: float) -> Grid:
    """Drive at full speed, slower on the side to turn to; positive turns are clockwise."""
    columns = np.arange(shape[1]) - (shape[1] - 1) / 2
    side = np.broadcast_to(np.sign(columns), shape)
    return np.clip(1.0 - side * turn, -1.0, 1.0).astype(np.float32)


def braitenberg(body: NDArray[np.int8], gain: float) -> Controller:
    """Steer by the difference between the outermost light sensors."""
    left, right = outermost(body, ncrs_envs.Cell.LIGHT_SENSOR)

    def act(observation: Grid) -> Grid:
        return throttle(body.shape, gain * (observation[right] - observation[left]))

    return act


def catch_and_carry(body: NDArray[np.int8], gain: float) -> Controller:
    """Steer by the ball and, once that is near, by the target."""
    left, right = outermost(body, ncrs_envs.Cell.LIGHT_SENSOR)
    target_left, target_right = outermost(body, ncrs_envs.Cell.TARGET_SENSOR)

    def act(observation: Grid) -> Grid:
        if observation[left] + observation[right] > 2 * CAUGHT:
            turn = CARRYING_GAIN * (observation[target_right] - observation[target_left])
        else:
            turn = gain * (observation[right] - observation[left])
        return throttle(body.shape, turn)

    return act


def run(
    task: str, controller: Controller, episodes: int, body: list[str] | None = None
) -> tuple[float, int]:
    """Run episodes; returns the mean reward per step, and the number of successful episodes.

    Args:
        task: Name of the task.
        controller: Function from each observation to an action.
        episodes: Number of episodes; the four regions take turns.
        body: Rows of cells; None for the task's body in ``BODIES``.
    """
    env = gymnasium.make(ncrs_envs.TASKS[task].env_id, body=body or BODIES[task])
    rewards, successes = [], 0
    for seed in range(episodes):
        observation, info = env.reset(seed=seed, options={"region": seed % 4})
        truncated = False
        while not truncated:
            observation, reward, _, truncated, info = env.step(controller(observation))
            rewards.append(reward)
        successes += info["success"]
    return float(np.mean(rewards)), successes


def main() -> None:
    """Run all and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--episodes", type=int, default=100, help="default: %(default)s")
    episodes = parser.parse_args().episodes
    print(f"{'task':<14}{'controller':<16}{'fitness':>8}{'success':>9}  95 % interval")
    for task, rows in BODIES.items():
        body = ncrs_envs.parse_body(rows)
        controllers: dict[str, tuple[Controller, list[str]]] = {
            "random": (random_actions(0), rows),
            "full throttle": (full_throttle, rows),
            "Braitenberg": (braitenberg(body, GAIN[task]), rows),
        }
        if task == "obstacle":
            controllers["arrow"] = (full_throttle, ARROW)
        if task == "carry_ball":
            controllers["catch and carry"] = (catch_and_carry(body, GAIN[task]), rows)
        for name, (controller, own_body) in controllers.items():
            fitness, successes = run(task, controller, episodes, own_body)
            success, low, high = Proportion.of(successes, episodes).percentages()
            print(f"{task:<14}{name:<16}{fitness:>8.4f}{success:>9}  {low} to {high}")


if __name__ == "__main__":
    main()
