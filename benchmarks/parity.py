"""Agreement of the batched simulator with Box2D: ``python -m benchmarks.parity [--json]``.

Both simulators replay the same actions in the same scenarios with the same bodies.

- Free motion: random bodies and actions; the distance of the robots' centres after 100 steps.
- Contact: a controller drives Box2D's robot at the light, the ball or the walls, and its actions
  are replayed; the difference in fitness (mean reward over 100 steps), and agreement in success.
  Beside it stands Box2D against itself with the start moved by 1e-4 units. No simulator can be
  expected to come closer than this effect of a change too small to see.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.dtypes import records
from ncrs_envs.batched.dynamics import grid_center
from ncrs_envs.batched.layout import State
from ncrs_envs.batched.records import single_world
from ncrs_envs.batched.simulate import reset_episode, step_episode
from ncrs_envs.body import BodyGrid, Cell, cell_centers
from ncrs_envs.episode import Episode, Robot
from ncrs_envs.physics import wheel_model
from ncrs_envs.scenario import Point, Scenario, ScenarioError, sample_scenario
from ncrs_envs.tasks import MAX_EPISODE_STEPS, TASKS, Task, TaskSettings, get_task

Actions = NDArray[np.float32]

MAX_FREE_DISTANCE = 0.01
MAX_FITNESS_DIFFERENCE = 0.005
MAX_FITNESS_BIAS = 0.001
MIN_SUCCESS_AGREEMENT = 0.97
START_SHIFT = 1e-4
_MAX_DISTANCE = 30.0
"""Maximum distance of the light or ball from the start, in units; far lights: 4 times that."""
_FAR_LIGHTS = 0.3
"""Fraction of lights that are far."""
_WORST = 5
_MAX_PLACES = 10_000


@dataclass(frozen=True)
class Run:
    """One replayed episode."""

    fitness: float
    success: bool
    touched: bool
    center: tuple[float, float]


@dataclass(frozen=True)
class Case:
    """An episode to replay."""

    seed: int
    body: BodyGrid
    scenario: Scenario
    actions: Actions
    """Actions, float32 ``(steps, n, n)``."""


def random_body(task: Task, rng: np.random.Generator, grid_size: int) -> BodyGrid:
    """Draw a valid body of random cells, a random fraction of which is empty."""
    while True:
        codes = [int(cell) for cell in task.part_cells]
        body = rng.choice(codes, size=(grid_size, grid_size)).astype(np.int8)
        body[rng.random(body.shape) < rng.uniform(0.0, 0.9)] = Cell.EMPTY
        if task.is_valid(body):
            return body


def unstable_body(rng: np.random.Generator, grid_size: int) -> BodyGrid:
    """Draw a LightChase body of one sensor and wheels that needs implicit friction."""
    while True:
        body = np.full((grid_size, grid_size), Cell.EMPTY, dtype=np.int8)
        cells = rng.permutation(body.size)[: rng.integers(3, grid_size + 4)]
        body.reshape(-1)[cells] = Cell.WHEEL
        body.reshape(-1)[cells[0]] = Cell.LIGHT_SENSOR
        if wheel_model(body).implicit:
            return body


def run_box2d(task: Task, case: Case) -> Run:
    """Replay a case on Box2D."""
    episode = Episode(TaskSettings(task.name, case.body.shape[0]), Robot(case.body), case.scenario)
    rewards, touched = [], False
    for action in case.actions:
        rewards.append(episode.step(action))
        touched = touched or episode.world.touching
    return Run(float(np.mean(rewards)), episode.success, touched, episode.pose[:2])


def run_batched(task: Task, case: Case) -> Run:
    """Replay a case on the batched simulator's kernels."""
    n = case.body.shape[0]
    world = single_world(TaskSettings(task.name, n), case.body, case.scenario)
    state: State = records(State, 1)[0]
    observation = np.zeros(n * n, dtype=np.float32)
    reset_episode(world, state, observation)
    rewards, touched = [], False
    for action in case.actions.reshape(len(case.actions), -1):
        rewards.append(step_episode(world, state, action, observation))
        touched = touched or bool(state.touched)
    center = grid_center(world.robot, state)
    return Run(float(np.mean(rewards)), bool(state.success), touched, center)


def free_cases(count: int, sizes: Sequence[int] = (3, 5, 5, 7), first: int = 0) -> Iterator[Case]:
    """Draw random bodies and actions in the open, with the light out of the way.

    Every fourth body is unstable. Actions are white noise, or held for 20 steps at a time, which
    leads further.

    Args:
        count: Number of cases.
        sizes: Sides of the grid to choose from.
        first: Seed of the first case; the others follow.
    """
    task = get_task("light_chase")
    for seed in range(first, first + count):
        rng = np.random.default_rng([1, seed])
        n = int(rng.choice(sizes))
        body = unstable_body(rng, n) if seed % 4 == 3 else random_body(task, rng, n)
        actions = rng.uniform(-1.0, 1.0, (MAX_EPISODE_STEPS, n, n))
        if seed % 8 < 4:
            actions = np.repeat(np.sign(actions[::20]), 20, axis=0)
        scenario = Scenario(start=(0.0, 0.0), light=(1000.0, 0.0))
        yield Case(seed, body, scenario, actions.astype(np.float32))


def contact_cases(
    task: Task, count: int, sizes: Sequence[int] = (3, 5, 5, 5, 7), first: int = 0
) -> Iterator[Case]:
    """Draw episodes in which a controller drives Box2D's robot at something; see ``free_cases``."""
    for seed in range(first, first + count):
        rng = np.random.default_rng([2, seed])
        n = int(rng.choice(sizes))
        body = random_body(task, rng, n)
        scenario = sample_scenario(task, rng, grid_size=n)
        if scenario.walls is None:
            scenario = _ahead(scenario, rng)
        else:
            scenario = _in_the_funnel(task, body, scenario, rng)
        yield Case(seed, body, scenario, _drive(task, body, scenario, rng))


def _from(point: Point, bearing: float, distance: float) -> Point:
    """Find the point at a distance in a direction; bearing 0 is +y."""
    return (point[0] - distance * math.sin(bearing), point[1] + distance * math.cos(bearing))


def _ahead(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """Move the light or ball ahead of the robot, and the target beyond the ball.

    Distances are such that some robots succeed and others do not.
    """
    bearing = rng.uniform(-0.5, 0.5)
    if scenario.ball is None:
        far = rng.random() < _FAR_LIGHTS
        low, high = (_MAX_DISTANCE, 4.0 * _MAX_DISTANCE) if far else (8.0, _MAX_DISTANCE)
        distance = rng.uniform(low, high)
        return replace(scenario, light=_from(scenario.start, bearing, distance))
    ball = _from(scenario.start, bearing, rng.uniform(8.0, _MAX_DISTANCE))
    target = _from(ball, bearing + rng.uniform(-0.4, 0.4), rng.uniform(11.0, 50.0))
    return replace(scenario, ball=ball, target=target)


def _in_the_funnel(
    task: Task, body: BodyGrid, scenario: Scenario, rng: np.random.Generator
) -> Scenario:
    """Move the robot to a free place near the passage, and the light behind the passage."""
    for _ in range(_MAX_PLACES):
        x, y = passage(scenario)
        start = (x + rng.uniform(-15.0, 15.0), rng.uniform(-35.0, -5.0))
        light = _from((x, y), rng.uniform(-1.0, 1.0), rng.uniform(10.0, 40.0))
        moved = replace(scenario, start=start, light=light)
        episode = Episode(TaskSettings(task.name, body.shape[0]), Robot(body), moved)
        episode.step(np.zeros(body.shape))
        # Box2D pushes a robot out of what it overlaps; positions are float32 there.
        if not episode.world.touching and math.dist(episode.pose[:2], start) < START_SHIFT:
            return moved
    raise ScenarioError(f"No free place near the passage in {_MAX_PLACES} draws.")


def passage(scenario: Scenario) -> Point:
    """Find the middle of the gap between the walls' upper ends."""
    assert scenario.walls is not None
    (left, y), (right, _) = (line[-1] for line in scenario.walls)
    return ((left + right) / 2.0, y)


def _drive(task: Task, body: BodyGrid, scenario: Scenario, rng: np.random.Generator) -> Actions:
    """Drive at the ball, or through the passage at the light; returns the actions.

    Noise, held for 10 steps at a time, makes the robot miss now and then.
    """
    n = body.shape[0]
    episode = Episode(TaskSettings(task.name, n), Robot(body), scenario)
    side = np.sign(cell_centers(n)[..., 0])
    actions = np.empty((MAX_EPISODE_STEPS, n, n), dtype=np.float32)
    noise = np.repeat(rng.normal(0.0, 0.3, (MAX_EPISODE_STEPS // 10, n, n)), 10, axis=0)
    for step in range(MAX_EPISODE_STEPS):
        x, y, angle = episode.pose
        goal = episode.ball or scenario.light
        assert goal is not None
        if scenario.walls is not None and y < passage(scenario)[1]:
            goal = passage(scenario)
        error = math.atan2(x - goal[0], goal[1] - y) - angle
        error = math.atan2(math.sin(error), math.cos(error))
        gas = math.cos(error) + error * side + noise[step]
        actions[step] = np.clip(gas, -1.0, 1.0)
        episode.step(actions[step])
    return actions


def compare_free(count: int) -> dict[str, Any]:
    """Compare free motion of ``count`` random bodies; see the module."""
    task = get_task("light_chase")
    apart, implicit = [], []
    for case in free_cases(count):
        box2d, batched = run_box2d(task, case), run_batched(task, case)
        apart.append(math.dist(box2d.center, batched.center))
        implicit.append(Robot(case.body).wheels.implicit)
    return {
        "bodies": count,
        "unstable_bodies": int(np.sum(implicit)),
        "max_distance": float(np.max(apart)),
        "max_distance_unstable": float(np.max(np.array(apart)[implicit], initial=0.0)),
        "met": bool(np.max(apart) <= MAX_FREE_DISTANCE),
    }


def _differences(runs: list[tuple[Run, Run]]) -> dict[str, float]:
    difference = np.array([b.fitness - a.fitness for a, b in runs])
    return {
        "mean_absolute": float(np.abs(difference).mean()),
        "bias": float(difference.mean()),
        "max_absolute": float(np.abs(difference).max()),
        "success_agreement": float(np.mean([a.success == b.success for a, b in runs])),
    }


def compare_contact(task: Task, count: int) -> dict[str, Any]:
    """Compare contact episodes of one task; see the module."""
    against_batched, against_itself = [], []
    worst: list[dict[str, Any]] = []
    for case in contact_cases(task, count):
        box2d, batched = run_box2d(task, case), run_batched(task, case)
        start = case.scenario.start
        moved = replace(case.scenario, start=(start[0] + START_SHIFT, start[1]))
        shifted = run_box2d(task, replace(case, scenario=moved))
        against_batched.append((box2d, batched))
        against_itself.append((box2d, shifted))
        worst.append(
            {
                "seed": case.seed,
                "cells": int((case.body != Cell.EMPTY).sum()),
                "box2d": asdict(box2d),
                "batched": asdict(batched),
                "box2d_shifted_fitness": shifted.fitness,
            }
        )
    worst.sort(key=lambda run: -abs(run["batched"]["fitness"] - run["box2d"]["fitness"]))
    differences = _differences(against_batched)
    return {
        "episodes": count,
        "touching": sum(a.touched for a, _ in against_batched),
        "successful": sum(a.success for a, _ in against_batched),
        **differences,
        "box2d_against_itself": _differences(against_itself),
        "worst": worst[:_WORST],
        "met": (
            differences["mean_absolute"] <= MAX_FITNESS_DIFFERENCE
            and abs(differences["bias"]) <= MAX_FITNESS_BIAS
            and differences["success_agreement"] >= MIN_SUCCESS_AGREEMENT
        ),
    }


def _print_table(results: dict[str, Any]) -> None:
    free = results["free"]
    print(
        f"Free motion, {free['bodies']} bodies ({free['unstable_bodies']} unstable): centres apart "
        f"by at most {free['max_distance']:.2e} units after {MAX_EPISODE_STEPS} steps "
        f"(unstable {free['max_distance_unstable']:.2e}; bar {MAX_FREE_DISTANCE}).\n"
    )
    print(
        f"{'contact':<22}{'episodes':>9}{'touching':>9}{'solved':>8}{'|diff|':>9}"
        f"{'bias':>10}{'max':>9}{'success':>9}"
    )
    for name, row in results["contact"].items():
        for label, part in ((name, row), ("  box2d, shifted", row["box2d_against_itself"])):
            print(
                f"{label:<22}{row['episodes']:>9}{row['touching']:>9}"
                f"{row['successful']:>8}{part['mean_absolute']:>9.5f}{part['bias']:>10.5f}"
                f"{part['max_absolute']:>9.4f}{part['success_agreement']:>9.1%}"
            )
    print(
        f"{'bar':<22}{'':>9}{'':>9}{'':>8}{MAX_FITNESS_DIFFERENCE:>9.5f}{MAX_FITNESS_BIAS:>10.5f}"
        f"{'':>9}{MIN_SUCCESS_AGREEMENT:>9.1%}"
    )
    for name, row in results["contact"].items():
        print(f"\nWorst of {name}: fitness on box2d, batched, and box2d with its start moved")
        for case in row["worst"]:
            print(
                f"  seed {case['seed']:>4}, {case['cells']:>2} cells: "
                f"{case['box2d']['fitness']:.4f} {case['batched']['fitness']:.4f} "
                f"{case['box2d_shifted_fitness']:.4f}"
            )


def main(arguments: list[str] | None = None) -> int:
    """Run the comparison; returns 1 if a bar is missed."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--bodies", type=int, default=240, help="bodies in free motion")
    parser.add_argument("--episodes", type=int, default=320, help="contact episodes per task")
    parser.add_argument("--tasks", nargs="+", default=list(TASKS), choices=list(TASKS))
    options = parser.parse_args(arguments)
    results: dict[str, Any] = {
        "free": compare_free(options.bodies),
        "contact": {n: compare_contact(get_task(n), options.episodes) for n in options.tasks},
    }
    if options.json:
        print(json.dumps(results, indent=2))
    else:
        _print_table(results)
    return 0 if all(r["met"] for r in [results["free"], *results["contact"].values()]) else 1


if __name__ == "__main__":
    sys.exit(main())
