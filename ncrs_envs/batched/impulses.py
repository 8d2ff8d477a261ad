"""Sequential impulses on contact points, and the correction of overlaps.

Restitution is 0. Both loops stop early once they have converged.
"""

from __future__ import annotations

from typing import NamedTuple

from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.dynamics import BALL_INVERSE_INERTIA, BALL_INVERSE_MASS, turn_to
from ncrs_envs.batched.layout import Contact, Robot, State
from ncrs_envs.batched.manifolds import FACE_OF_WALL, FACE_TO_BALL, LINEAR_SLOP
from ncrs_envs.physics import CONTACT_FRICTION

_VELOCITY_ITERATIONS = 180
_SETTLED_SPEED = 1e-6
"""Units per second; the iteration ends once no contact point's speed changes by more."""
_MAX_CORRECTION = 0.2


class Correction(NamedTuple):
    """Parameters of the correction of overlaps."""

    fraction: float
    """Fraction of an overlap that one correction removes."""
    sweeps: int
    """Maximum number of sweeps over all points."""
    tolerated: float
    """Maximum overlap of skins at which the correction stops."""


@kernel
def _locate(contact: Contact, state: State) -> tuple[float, float, float, float, float]:
    """Return a contact point's world normal towards the robot, world position and separation."""
    cos = state.cos
    sin = state.sin
    n_x = contact.face_nx
    n_y = contact.face_ny
    f_x = contact.face_x
    f_y = contact.face_y
    p_x = contact.point_x
    p_y = contact.point_y
    if contact.kind == FACE_OF_WALL:
        x = state.x + cos * p_x - sin * p_y
        y = state.y + sin * p_x + cos * p_y
        distance = n_x * (x - f_x) + n_y * (y - f_y)
        return n_x, n_y, x, y, distance - contact.radii
    if contact.kind == FACE_TO_BALL:
        p_x = state.ball_x
        p_y = state.ball_y
    out_x = cos * n_x - sin * n_y
    out_y = sin * n_x + cos * n_y
    x = state.x + cos * f_x - sin * f_y
    y = state.y + sin * f_x + cos * f_y
    distance = out_x * (p_x - x) + out_y * (p_y - y)
    return -out_x, -out_y, p_x, p_y, distance - contact.radii


class _Velocities(NamedTuple):
    """Velocities of robot and ball, held in registers while they are solved for."""

    x: float
    y: float
    omega: float
    ball_x: float
    ball_y: float
    ball_omega: float


class _Inverse(NamedTuple):
    """Inverse mass and inertia of the robot."""

    mass: float
    inertia: float


@kernel
def _pushed(
    inverse: _Inverse, v: _Velocities, contact: Contact, impulse_x: float, impulse_y: float
) -> _Velocities:
    """Return the velocities after an impulse on the robot, and its reaction on the ball."""
    x = v.x + inverse.mass * impulse_x
    y = v.y + inverse.mass * impulse_y
    omega = v.omega + inverse.inertia * (contact.arm_x * impulse_y - contact.arm_y * impulse_x)
    ball_x = v.ball_x
    ball_y = v.ball_y
    ball_omega = v.ball_omega
    if contact.kind == FACE_TO_BALL:
        arm_x = contact.ball_arm_x
        arm_y = contact.ball_arm_y
        ball_x -= BALL_INVERSE_MASS * impulse_x
        ball_y -= BALL_INVERSE_MASS * impulse_y
        ball_omega -= BALL_INVERSE_INERTIA * (arm_x * impulse_y - arm_y * impulse_x)
    return _Velocities(x, y, omega, ball_x, ball_y, ball_omega)


@kernel
def _prepare(
    inverse: _Inverse, v: _Velocities, state: State, contacts: NDArray[Contact], keep: bool
) -> _Velocities:
    """Set the solver's half of the contacts, and return the velocities after first impulses."""
    for i in range(len(contacts)):
        contact: Contact = contacts[i]
        n_x, n_y, x, y, separation = _locate(contact, state)
        # Forces act midway between the two surfaces, along the face's outward normal.
        outward = 1.0 if contact.kind == FACE_OF_WALL else -1.0
        radii = contact.radii
        middle = 0.5 * (2.0 * contact.face_radius - radii - (separation + radii))
        x += middle * outward * n_x
        y += middle * outward * n_y
        arm_x = x - state.x
        arm_y = y - state.y
        normal_arm = arm_x * n_y - arm_y * n_x
        tangent_arm = arm_x * n_x + arm_y * n_y
        by_normal = inverse.mass + inverse.inertia * normal_arm * normal_arm
        by_tangent = inverse.mass + inverse.inertia * tangent_arm * tangent_arm
        if contact.kind == FACE_TO_BALL:
            ball_x = x - state.ball_x
            ball_y = y - state.ball_y
            normal_arm = ball_x * n_y - ball_y * n_x
            tangent_arm = ball_x * n_x + ball_y * n_y
            by_normal += BALL_INVERSE_MASS + BALL_INVERSE_INERTIA * normal_arm * normal_arm
            by_tangent += BALL_INVERSE_MASS + BALL_INVERSE_INERTIA * tangent_arm * tangent_arm
            contact.ball_arm_x = ball_x
            contact.ball_arm_y = ball_y
        contact.normal_x = n_x
        contact.normal_y = n_y
        contact.arm_x = arm_x
        contact.arm_y = arm_y
        contact.normal_mass = 1.0 / by_normal
        contact.tangent_mass = 1.0 / by_tangent
        normal = contact.normal_impulse if keep else 0.0
        tangent = contact.tangent_impulse if keep else 0.0
        contact.normal_impulse = normal
        contact.tangent_impulse = tangent
        impulse_x = normal * n_x - tangent * n_y
        impulse_y = normal * n_y + tangent * n_x
        v = _pushed(inverse, v, contact, impulse_x, impulse_y)
    return v


@kernel
def _approach(v: _Velocities, contact: Contact) -> tuple[float, float]:
    """Return the robot's velocity at a contact point, relative to the other shape."""
    v_x = v.x - v.omega * contact.arm_y
    v_y = v.y + v.omega * contact.arm_x
    if contact.kind == FACE_TO_BALL:
        v_x -= v.ball_x - v.ball_omega * contact.ball_arm_y
        v_y -= v.ball_y + v.ball_omega * contact.ball_arm_x
    return v_x, v_y


@kernel
def solve_velocities(robot: Robot, state: State, contacts: NDArray[Contact], keep: bool) -> None:
    """Change velocities so that no contact point approaches, with Coulomb friction.

    Args:
        robot: The robot.
        state: The episode's state, changed.
        contacts: The contact points.
        keep: True to begin with the impulses of the step before, which hold a robot that is jammed
            between two faces; False to begin with none.
    """
    inverse = _Inverse(robot.inverse_mass, robot.inverse_inertia)
    v = _Velocities(state.vx, state.vy, state.omega, state.ball_vx, state.ball_vy, state.ball_omega)
    v = _prepare(inverse, v, state, contacts, keep)
    for _ in range(_VELOCITY_ITERATIONS):
        moves = False
        for i in range(len(contacts)):
            contact: Contact = contacts[i]
            n_x = contact.normal_x
            n_y = contact.normal_y
            v_x, v_y = _approach(v, contact)
            mass = contact.tangent_mass
            limit = CONTACT_FRICTION * contact.normal_impulse
            old = contact.tangent_impulse
            new = min(max(old - mass * (n_x * v_y - n_y * v_x), -limit), limit)
            if new != old:
                contact.tangent_impulse = new
                v = _pushed(inverse, v, contact, -(new - old) * n_y, (new - old) * n_x)
                moves = moves or abs(new - old) >= _SETTLED_SPEED * mass
                v_x, v_y = _approach(v, contact)
            mass = contact.normal_mass
            old = contact.normal_impulse
            new = max(old - mass * (n_x * v_x + n_y * v_y), 0.0)
            if new != old:
                contact.normal_impulse = new
                v = _pushed(inverse, v, contact, (new - old) * n_x, (new - old) * n_y)
                moves = moves or abs(new - old) >= _SETTLED_SPEED * mass
        if not moves:
            break
    state.vx = v.x
    state.vy = v.y
    state.omega = v.omega
    state.ball_vx = v.ball_x
    state.ball_vy = v.ball_y
    state.ball_omega = v.ball_omega


@kernel
def correct_positions(
    robot: Robot, state: State, contacts: NDArray[Contact], correction: Correction
) -> None:
    """Move bodies apart along their contact normals until little overlap is left.

    Args:
        robot: The robot.
        state: The episode's state, changed.
        contacts: The contact points.
        correction: Parameters of the correction.
    """
    inverse_mass = robot.inverse_mass
    inverse_inertia = robot.inverse_inertia
    for _ in range(correction.sweeps):
        deepest = 0.0
        for i in range(len(contacts)):
            contact: Contact = contacts[i]
            n_x, n_y, x, y, separation = _locate(contact, state)
            deepest = min(deepest, separation)
            distance = correction.fraction * -(separation + LINEAR_SLOP)
            distance = min(max(distance, 0.0), _MAX_CORRECTION)
            if distance == 0.0:
                continue
            arm_x = x - state.x
            arm_y = y - state.y
            normal_arm = arm_x * n_y - arm_y * n_x
            compliance = inverse_mass + inverse_inertia * normal_arm * normal_arm
            is_ball = contact.kind == FACE_TO_BALL
            if is_ball:
                compliance += BALL_INVERSE_MASS
            impulse = distance / compliance
            state.x += inverse_mass * impulse * n_x
            state.y += inverse_mass * impulse * n_y
            turn_to(state, state.angle + inverse_inertia * impulse * normal_arm)
            if is_ball:
                state.ball_x -= BALL_INVERSE_MASS * impulse * n_x
                state.ball_y -= BALL_INVERSE_MASS * impulse * n_y
        if deepest >= -correction.tolerated:
            break
