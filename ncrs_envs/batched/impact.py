"""First time in a step at which the robot meets the light or a wall, along separating axes.

Light and walls are solid to a robot of any speed: the step is cut where it first touches one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.geometry import (
    HALF_CELL,
    Frame,
    face_of_cell,
    quad_to_cell_frame,
    separation_along_cell,
    separation_along_quad,
    separation_from_point,
)
from ncrs_envs.batched.layout import Point, Quad, State, World
from ncrs_envs.batched.manifolds import LINEAR_SLOP, SKIN, distance_from_quad
from ncrs_envs.physics import LIGHT_RADIUS

_LIGHT = -1
"""Stands for the light in place of a quad's index."""
_NO_FACE = -1

# Box2D stops bodies where their skins overlap by three slops, and calls it a touch slightly before.
_TARGET_OVERLAP = 3.0 * LINEAR_SLOP
_TOLERANCE = 0.25 * LINEAR_SLOP
_MAX_AXES = 20
_MAX_ROOT_ITERATIONS = 50
_HALF_DIAGONAL = HALF_CELL * 2.0**0.5


class Pose(NamedTuple):
    """Centre of mass and angle, or their change in a move."""

    x: float
    y: float
    angle: float


class Sweep(NamedTuple):
    """The robot's move."""

    start: Pose
    move: Pose
    length: float
    """Distance that the centre of mass moves, in units."""
    cos: float
    """Cosine and sine of the angle at the start."""
    sin: float
    ignore_touching: bool
    """True to ignore shapes that touch at the start already."""


class _Axis(NamedTuple):
    """A separating axis: a face of the cell, or a direction in the world towards the cell."""

    face: int
    """``_NO_FACE`` for a world direction."""
    n_x: float
    n_y: float


@kernel
def _separate(world: World, thing: int, frame: Frame) -> tuple[float, _Axis]:
    """Return a cell core's separation from a quad's core or the light's centre, and its axis."""
    if thing == _LIGHT:
        from_x = world.scenario.goal_x - frame.x
        from_y = world.scenario.goal_y - frame.y
        light: Point = world.corners[0]
        light.x = frame.cos * from_x + frame.sin * from_y
        light.y = frame.cos * from_y - frame.sin * from_x
        distance, n_x, n_y = separation_from_point(light.x, light.y)
        if n_x == 0.0 or n_y == 0.0:
            distance, _, _, face = separation_along_cell(world.corners[:1])
            return distance, _Axis(face, 0.0, 0.0)
    else:
        quad: Quad = world.quads[thing]
        distance, n_x, n_y, _ = separation_along_quad(quad, frame)
        count = quad_to_cell_frame(quad, frame, world.corners)
        by_cell, _, _, face = separation_along_cell(world.corners[:count])
        if by_cell > distance:
            return by_cell, _Axis(face, 0.0, 0.0)
    out_x = frame.cos * n_x - frame.sin * n_y
    out_y = frame.sin * n_x + frame.cos * n_y
    return distance, _Axis(_NO_FACE, out_x, out_y)


@kernel
def _separation_along(world: World, thing: int, frame: Frame, axis: _Axis) -> float:
    """Return the separation of a cell from a quad or the light's centre along a given axis."""
    if axis.face != _NO_FACE:
        f_x, f_y = face_of_cell(axis.face)
        n_x = frame.cos * f_x - frame.sin * f_y
        n_y = frame.sin * f_x + frame.cos * f_y
        nearest = math.inf
        if thing == _LIGHT:
            from_x = world.scenario.goal_x - frame.x
            from_y = world.scenario.goal_y - frame.y
            nearest = n_x * from_x + n_y * from_y
        else:
            quad: Quad = world.quads[thing]
            for i in range(quad.corner_count):
                corner: Point = quad.corners[i]
                from_x = corner.x - frame.x
                from_y = corner.y - frame.y
                nearest = min(nearest, n_x * from_x + n_y * from_y)
        return nearest - HALF_CELL
    n_x = axis.n_x
    n_y = axis.n_y
    farthest = -math.inf
    if thing == _LIGHT:
        farthest = n_x * world.scenario.goal_x + n_y * world.scenario.goal_y
    else:
        quad = world.quads[thing]
        for i in range(quad.corner_count):
            corner = quad.corners[i]
            farthest = max(farthest, n_x * corner.x + n_y * corner.y)
    own_x = frame.cos * n_x + frame.sin * n_y
    own_y = frame.cos * n_y - frame.sin * n_x
    return n_x * frame.x + n_y * frame.y - HALF_CELL * (abs(own_x) + abs(own_y)) - farthest


@kernel
def _cell_at(sweep: Sweep, time: float, cell: Point) -> Frame:
    """Return the frame of a cell after the fraction ``time`` of the move."""
    angle = sweep.start.angle + time * sweep.move.angle
    cos = math.cos(angle)
    sin = math.sin(angle)
    x = sweep.start.x + time * sweep.move.x + cos * cell.x - sin * cell.y
    y = sweep.start.y + time * sweep.move.y + sin * cell.x + cos * cell.y
    return Frame(x, y, cos, sin)


@kernel
def _time_of_cell(world: World, thing: int, sweep: Sweep, cell: Point, latest: float) -> float:
    """Return the fraction of the move after which a cell touches a quad or the light.

    It is at most ``latest``. If the present separating axis still separates at the end, the cell is
    free. Otherwise the time at which it stops separating is the time of touch, unless another axis
    separates then.
    """
    radii = LIGHT_RADIUS + SKIN if thing == _LIGHT else 2.0 * SKIN
    target = radii - _TARGET_OVERLAP
    time = 0.0
    for _ in range(_MAX_AXES):
        distance, axis = _separate(world, thing, _cell_at(sweep, time, cell))
        if distance < target + _TOLERANCE:
            is_ignored = time == 0.0 and (distance <= 0.0 or sweep.ignore_touching)
            return latest if is_ignored else min(time, latest)
        free = time
        blocked = 1.0
        end = _separation_along(world, thing, _cell_at(sweep, blocked, cell), axis)
        if end > target - _TOLERANCE:
            return latest
        begin = distance
        for iteration in range(_MAX_ROOT_ITERATIONS):
            # Bisection and the secant rule in turn: one is safe, the other fast.
            if iteration % 2 == 1:
                time = 0.5 * (free + blocked)
            else:
                time = free + (target - begin) * (blocked - free) / (end - begin)
            middle = _separation_along(world, thing, _cell_at(sweep, time, cell), axis)
            if abs(middle - target) < _TOLERANCE:
                break
            if middle > target:
                free = time
                begin = middle
            else:
                blocked = time
                end = middle
        if time >= latest:
            return latest
    return time


@kernel
def make_sweep(start: Pose, state: State, ignore_touching: bool) -> Sweep:
    """Return the move from ``start`` to the state's pose."""
    move = Pose(state.x - start.x, state.y - start.y, state.angle - start.angle)
    length = math.sqrt(move.x * move.x + move.y * move.y)
    cos, sin = math.cos(start.angle), math.sin(start.angle)
    return Sweep(start, move, length, cos, sin, ignore_touching)


@kernel
def can_reach_light(world: World, sweep: Sweep) -> bool:
    """Return True if the robot may touch the light during the move."""
    away_x = world.scenario.goal_x - sweep.start.x
    away_y = world.scenario.goal_y - sweep.start.y
    reach = world.robot.radius + sweep.length + LIGHT_RADIUS + SKIN
    return bool(away_x * away_x + away_y * away_y <= reach * reach)


@kernel
def can_reach_quad(world: World, sweep: Sweep, thing: int) -> bool:
    """Return True if the robot may touch a quad during the move."""
    reach = world.robot.radius + sweep.length + 2.0 * SKIN
    quad: Quad = world.quads[thing]
    return bool(distance_from_quad(quad, sweep.start.x, sweep.start.y) <= reach)


@kernel
def time_at_light(world: World, sweep: Sweep, cell: int, latest: float) -> float:
    """Return the fraction of the move before an exposed cell meets the light, or ``latest``."""
    return _time_of_cell(world, _LIGHT, sweep, world.exposed[cell], latest)


@kernel
def can_cell_reach(world: World, sweep: Sweep, thing: int, cell: int) -> bool:
    """Return True if an exposed cell may touch a quad during the move."""
    start, move = sweep.start, sweep.move
    point: Point = world.exposed[cell]
    x = start.x + sweep.cos * point.x - sweep.sin * point.y
    y = start.y + sweep.sin * point.x + sweep.cos * point.y
    arc = abs(move.angle) * math.sqrt(point.x * point.x + point.y * point.y)
    reach = _HALF_DIAGONAL + sweep.length + arc + 2.0 * SKIN
    return bool(distance_from_quad(world.quads[thing], x, y) <= reach)


@kernel
def time_at_quad(world: World, sweep: Sweep, thing: int, cell: int, latest: float) -> float:
    """Return the fraction of the move before an exposed cell meets a quad, or ``latest``."""
    return _time_of_cell(world, thing, sweep, world.exposed[cell], latest)


@kernel
def time_of_impact(
    world: World, near: tuple[int, int], start: Pose, state: State, ignore_touching: bool
) -> float:
    """Return the fraction of the move from ``start`` to the state's pose that is free, 1 for all.

    Overlaps at the start are left to the contact solver, as in Box2D.

    Args:
        world: The episode's world, whose buffer for corners is used.
        near: First index and end of the quads to check, from ``manifolds.near_quads``.
        start: Pose at the start of the move.
        state: The episode's state, with the pose at the end of the move.
        ignore_touching: True to ignore shapes that touch at the start already.
    """
    sweep = make_sweep(start, state, ignore_touching)
    latest = 1.0
    if can_reach_light(world, sweep):
        for i in range(world.robot.exposed_count):
            latest = time_at_light(world, sweep, i, latest)
    for thing in range(near[0], near[1]):
        if can_reach_quad(world, sweep, thing):
            for i in range(world.robot.exposed_count):
                if can_cell_reach(world, sweep, thing, i):
                    latest = time_at_quad(world, sweep, thing, i, latest)
    return latest
