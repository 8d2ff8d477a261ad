"""Contacts on a GPU: a warp's threads look for the contacts and impacts of its episodes together.

The scheme is that of ``ncrs_envs.batched.contacts``, in the same order. What has to be computed one
after the other, such as the impulses, is computed by one thread for each episode; pairs of a cell
and a piece of wall, which are many and independent, by all threads of the warp, one episode at a
time.
"""

from __future__ import annotations

from numba import cuda, float64, int32
from numpy.typing import NDArray

from ncrs.engines.cuda.layout import Buffers, Courses, Group, Move
from ncrs.engines.cuda.tiles import sync_warp
from ncrs_envs.batched.contacts import MAX_IMPACTS, move_back, move_in_contact, solve_impact
from ncrs_envs.batched.dynamics import move_robot
from ncrs_envs.batched.impact import (
    Pose,
    can_cell_reach,
    can_reach_light,
    can_reach_quad,
    make_sweep,
    time_at_light,
    time_at_quad,
)
from ncrs_envs.batched.layout import Contact, Point, State, World
from ncrs_envs.batched.manifolds import (
    cell_frame,
    circle_of,
    copy_contact,
    is_cell_near,
    is_circle_near,
    is_quad_near,
    near_quads,
    recall_impulses,
    touch_circle,
    touch_quad,
)
from ncrs_envs.cuda.gpu import CONTACT, POINT, WARP, device_function, inlined_on_gpu
from ncrs_envs.physics import DT


@inlined_on_gpu
def drive_world(
    courses: Courses,
    group: Group,
    episode: int,
    contacts: NDArray[Contact],
    corners: NDArray[Point],
) -> World:
    """Return the world of an episode of a group, with room for contacts and a quad's corners."""
    scenarios = courses.scenarios
    return World(
        courses.settings[0],
        courses.robots.robots[group.genome],
        courses.robots.wheels[group.genome],
        courses.robots.sensors[group.genome],
        courses.robots.exposed[group.genome],
        scenarios.scenarios[group.scenario_row, episode],
        scenarios.quads[group.scenario_row, episode],
        contacts,
        corners,
    )


@device_function
def _find_together(world: World, own: World, state: State, move: Move, scratch: int) -> None:
    """Write the contact points of an episode, in the order in which one thread would find them.

    Args:
        world: The episode's world.
        own: The same with this thread's own room for two contact points.
        state: The episode's state.
        move: The episode's move, whose number of contact points is set.
        scratch: Offset of the warp's scratch memory.
    """
    marks = cuda.shared.array(0, int32)
    lane = cuda.threadIdx.x % WARP
    exposed = world.robot.exposed_count
    capacity = world.contacts.shape[0]
    circle = circle_of(world, state)
    by_circle = is_circle_near(world, state, circle)
    things = 1 + max(0, move.end - move.first)
    pairs = things * exposed
    count = 0
    for begin in range(0, pairs, WARP):
        pair = begin + lane
        found = 0
        if pair < pairs:
            thing, cell = pair // exposed - 1, pair % exposed
            if thing < 0:
                if by_circle:
                    found = touch_circle(own.contacts, 0, circle, world.exposed[cell], cell)
            else:
                thing += move.first
                if is_quad_near(world, state, thing):
                    frame = cell_frame(state, world.exposed[cell])
                    if is_cell_near(world.quads[thing], frame):
                        found = touch_quad(own, thing, cell, frame, 0)
        marks[scratch + WARP + lane] = found
        sync_warp()
        place = count
        for other in range(WARP):
            number = marks[scratch + WARP + other]
            if other < lane:
                place += number
            count += number
        for i in range(found):
            if place + i < capacity:
                copy_contact(own.contacts[i], world.contacts[place + i])
        sync_warp()
    count = min(count, capacity)
    for i in range(lane, count, WARP):
        recall_impulses(state, world.contacts[i : i + 1])
    if lane == 0:
        move.count = count
    sync_warp()


@device_function
def _time_together(
    own: World, state: State, move: Move, ignore_touching: bool, scratch: int
) -> float:
    """Return the fraction of an episode's move that is free, to every thread of the warp."""
    wide = cuda.shared.array(0, float64)
    lane = cuda.threadIdx.x % WARP
    exposed = own.robot.exposed_count
    start = Pose(move.start_x, move.start_y, move.start_angle)
    sweep = make_sweep(start, state, ignore_touching)
    to_light = can_reach_light(own, sweep)
    pairs = (1 + max(0, move.end - move.first)) * exposed
    latest = 1.0
    for pair in range(lane, pairs, WARP):
        thing, cell = pair // exposed - 1, pair % exposed
        if thing < 0:
            if to_light:
                latest = time_at_light(own, sweep, cell, latest)
        else:
            thing += move.first
            if can_reach_quad(own, sweep, thing) and can_cell_reach(own, sweep, thing, cell):
                latest = time_at_quad(own, sweep, thing, cell, latest)
    times = (scratch + WARP) // 2
    wide[times + lane] = latest
    sync_warp()
    half = WARP // 2
    while half > 0:
        if lane < half:
            wide[times + lane] = min(wide[times + lane], wide[times + lane + half])
        sync_warp()
        half //= 2
    first: float = wide[times]
    sync_warp()
    return first


@device_function
def _share_flags(flag: bool, number: int, scratch: int) -> bool:
    """Show every thread of the warp the flags of its episodes; return True if any is set."""
    marks = cuda.shared.array(0, int32)
    sync_warp()
    marks[scratch + cuda.threadIdx.x % WARP] = 1 if flag else 0
    sync_warp()
    found = False
    for other in range(number):
        found = found or marks[scratch + other] != 0
    return found


@device_function
def _find_all(courses: Courses, buffers: Buffers, group: Group) -> None:
    """Find the contact points of all flagged episodes of the warp."""
    marks = cuda.shared.array(0, int32)
    found = cuda.local.array(2, CONTACT)
    corners = cuda.local.array(4, POINT)
    row, first, number, scratch = group.row, group.first, group.number, group.scratch
    for other in range(number):
        if marks[scratch + other] == 0:
            continue
        episode = first + other
        world = drive_world(courses, group, episode, buffers.contacts[row, episode], corners)
        own = drive_world(courses, group, episode, found, corners)
        state, move = buffers.states[row, episode], buffers.moves[row, episode]
        _find_together(world, own, state, move, scratch)


@device_function
def _time_all(courses: Courses, buffers: Buffers, group: Group, ignore_touching: bool) -> float:
    """Return the free fraction of the move of this thread's episode, if it is flagged, else 1."""
    marks = cuda.shared.array(0, int32)
    found = cuda.local.array(2, CONTACT)
    corners = cuda.local.array(4, POINT)
    row, first, number, scratch = group.row, group.first, group.number, group.scratch
    mine = 1.0
    for other in range(number):
        if marks[scratch + other] == 0:
            continue
        episode = first + other
        own = drive_world(courses, group, episode, found, corners)
        state, move = buffers.states[row, episode], buffers.moves[row, episode]
        time = _time_together(own, state, move, ignore_touching, scratch)
        if cuda.threadIdx.x % WARP == other:
            mine = time
    return mine


@device_function
def _start_move(move: Move, state: State) -> None:
    """Begin a move at the state's pose."""
    move.start_x = state.x
    move.start_y = state.y
    move.start_angle = state.angle


@device_function
def move_together(  # noqa: PLR0913 - inputs, and what this thread drives
    courses: Courses,
    buffers: Buffers,
    group: Group,
    world: World,
    state: State,
    touches: bool,
) -> None:
    """Move the warp's episodes that may touch something for one step, by all its threads.

    Args:
        courses: Inputs of the rollout.
        buffers: Memory of the episodes.
        group: The warp's episodes.
        world: World of the episode that this thread drives; any other thread's is not used.
        state: Its state.
        touches: True if this thread drives an episode that may touch something.
    """
    number, scratch = group.number, group.scratch
    if not _share_flags(touches, number, scratch):
        return
    last_episode = buffers.moves.shape[1] - 1
    own = min(group.first + cuda.threadIdx.x % WARP, last_episode)
    move = buffers.moves[group.row, own]
    if touches:
        _start_move(move, state)
        move.first, move.end = near_quads(world, state)
    sync_warp()
    _find_all(courses, buffers, group)
    if touches:
        move_in_contact(world, state, move.count)
    if world.settings.has_ball:
        return
    remaining = 1.0
    for impact in range(MAX_IMPACTS + 1):
        last = impact == MAX_IMPACTS
        sync_warp()
        time = _time_all(courses, buffers, group, last)
        touches = touches and time < 1.0
        if not _share_flags(touches, number, scratch):
            return
        if touches:
            start = Pose(move.start_x, move.start_y, move.start_angle)
            move_back(state, start, time)
            remaining *= 1.0 - time
        sync_warp()
        _find_all(courses, buffers, group)
        if touches:
            solve_impact(world, state, move.count)
            if not last:
                _start_move(move, state)
                move_robot(state, remaining * DT)
