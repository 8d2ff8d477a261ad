"""Curricula: scenarios that begin easy and become the task's own.

A curriculum eases scenarios that were drawn in the task's own way. Ease is 1 at the first
generation and falls linearly to 0, where they are as drawn.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ncrs_envs.body import CELL_SIZE
from ncrs_envs.physics import BALL_RADIUS
from ncrs_envs.registry import Registry
from ncrs_envs.scenario import WALL_EXTENT, Point, Polyline, Scenario, ScenarioError
from ncrs_envs.tasks import Task, playfield

NO_CURRICULUM = "none"
EaseFunction = Callable[[Scenario, float, Task, int], Scenario]
"""Function of a scenario, its ease from 0 to 1, the task and the grid size that returns an easier
scenario of the task, or the same one at ease 0. It must treat mirror images alike."""

_NEARER = 0.4
"""Share of the way to the light or ball that is spared at ease 1."""
_WIDER = 0.25
"""Distance that each wall gives way at ease 1, as a share of the playfield's half side."""
_ENDING = 0.75
"""Share of the ball's way that is behind it at ease 1."""
_GAP = 3.0
"""Distance of the robot's grid from the ball at ease 1, in ball radii."""
_BEHIND = 1.0 / 3.0
"""Share of the robots that begin right behind the ball at ease 1 of ``along``."""
_FULL_EASE = 0.625
"""Ease from which ``along`` begins to move robots back to their own starts."""
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
"""Golden ratio's fractional part; its multiples are spread evenly between the integers."""


def nearer(scenario: Scenario, ease: float, task: Task, grid_size: int) -> Scenario:
    """Bring the light, or the ball and the target, nearer to the start, and widen a passage."""
    spared = _NEARER * ease
    if scenario.ball is not None and scenario.target is not None:
        ball = _between(scenario.ball, scenario.start, spared)
        shift = (ball[0] - scenario.ball[0], ball[1] - scenario.ball[1])
        target = (scenario.target[0] + shift[0], scenario.target[1] + shift[1])
        return replace(scenario, ball=ball, target=_between(target, ball, spared))
    assert scenario.light is not None
    if scenario.walls is None:
        return replace(scenario, light=_between(scenario.light, scenario.start, spared))
    extent = playfield(grid_size)
    left, right = scenario.walls
    middle = 0.5 * (max(x for x, _ in left) + min(x for x, _ in right))
    way = _WIDER * ease * extent
    walls = (_moved(left, -way, extent), _moved(right, way, extent))
    light = (scenario.light[0] + (middle - scenario.light[0]) * ease, scenario.light[1])
    return replace(scenario, light=light, walls=walls)


def reverse(scenario: Scenario, ease: float, task: Task, grid_size: int) -> Scenario:
    """Begin near the end: the ball most of its way to the target, and the robot behind it.

    Where there is no ball the robot begins near the light.

    Raises:
        ScenarioError: If there are walls, between which no robot can begin.
    """
    if scenario.walls is not None:
        raise ScenarioError(
            f"The curriculum 'reverse' does not suit {task.name}: no robot can begin within its "
            "passage. Use 'nearer'."
        )
    if scenario.ball is None or scenario.target is None:
        assert scenario.light is not None
        return replace(scenario, start=_between(scenario.start, scenario.light, _NEARER * ease))
    ball = _between(scenario.ball, scenario.target, _ENDING * ease)
    behind = _behind(ball, scenario, grid_size)
    return replace(scenario, ball=ball, start=_between(scenario.start, behind, ease))


def along(scenario: Scenario, ease: float, task: Task, grid_size: int) -> Scenario:
    """Begin anywhere on the way to the ball, in a third of the scenarios right behind it.

    So a robot practises the end of the task and its beginning at the same time. The robots move
    back to their own starts in the last five eighths of the curriculum.

    Raises:
        ScenarioError: If there is no ball.
    """
    if scenario.ball is None:
        raise ScenarioError(
            f"The curriculum 'along' does not suit {task.name}, which has no ball. Use 'nearer'."
        )
    # The scenario decides its share of the way by itself, as its mirror images do.
    spread = (abs(scenario.ball[0] - scenario.start[0]) * _GOLDEN) % 1.0
    share = min(1.0, spread / (1.0 - _BEHIND)) * min(1.0, ease / _FULL_EASE)
    behind = _behind(scenario.ball, scenario, grid_size)
    return replace(scenario, start=_between(scenario.start, behind, share))


def _behind(ball: Point, scenario: Scenario, grid_size: int) -> Point:
    """Return the place right behind a ball, on the side of the scenario's start."""
    assert scenario.ball is not None
    gap = grid_size * CELL_SIZE / 2.0 + _GAP * BALL_RADIUS
    return (ball[0], ball[1] - math.copysign(gap, scenario.ball[1] - scenario.start[1]))


def _between(point: Point, other: Point, share: float) -> Point:
    """Return the point at a share of the way from ``point`` to ``other``."""
    return (point[0] + share * (other[0] - point[0]), point[1] + share * (other[1] - point[1]))


def _moved(line: Polyline, way: float, extent: float) -> Polyline:
    """Move a wall's edge sideways, but for what would leave the solid's outer side."""
    limit = WALL_EXTENT * extent
    return tuple((min(max(x + way, -limit), limit), y) for x, y in line)


OWN_CURRICULA: dict[str, EaseFunction | None] = {
    NO_CURRICULUM: None,
    "nearer": nearer,
    "reverse": reverse,
    "along": along,
}
"""Those that come with the package."""
CURRICULA: Registry[EaseFunction | None] = Registry("curriculum", OWN_CURRICULA)


def register_curriculum(name: str, ease: EaseFunction) -> None:
    """Make a curriculum known by name; raise ``ExtensionError`` if that is taken."""
    CURRICULA.register(name, ease)


def check_curriculum(name: Any) -> str:
    """Return ``name`` if it is a curriculum, else raise ``ScenarioError``."""
    return CURRICULA.check(name, "curriculum", ScenarioError)


def eased(
    scenarios: list[Scenario], name: str, ease: float, task: Task, grid_size: int
) -> list[Scenario]:
    """Ease scenarios, and check them.

    Args:
        scenarios: Scenarios of the task, as drawn.
        name: Name of the curriculum.
        ease: Ease, from 0 for the scenarios as they are to 1.
        task: Task of the scenarios.
        grid_size: Side of the body grid.

    Raises:
        ScenarioError: If the curriculum does not suit the task, or a scenario of it does not.
    """
    function = CURRICULA[name]
    if function is None or not ease:
        return scenarios
    easier = [function(scenario, ease, task, grid_size) for scenario in scenarios]
    for scenario in easier:
        scenario.check(task, grid_size)
    return easier
