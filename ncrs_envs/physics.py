"""Physical constants, and the wheel model, shared by all simulators.

All wheels of a robot are aligned with the body's axes. Their friction is therefore a linear map of
the robot's body-frame twist, and their thrust a linear map of the gas values. Both are constant for
a body. Lengths are in units, as in the paper, and time is in seconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.body import (
    HULL_DENSITY,
    BodyGrid,
    MassProperties,
    cell_centers,
    mass_properties,
    wheel_mask,
)

DT = 1.0 / 50.0
"""Duration of one env step (physics and control) in seconds."""

WHEEL_THRUST = 1000.0
"""Forward force of a wheel at gas 1."""
WHEEL_FORWARD_FRICTION = 20.0
"""Force per unit of speed along the wheel's forward axis."""
WHEEL_SIDE_FRICTION = 100.0
"""Force per unit of speed along the wheel's side axis."""

CONTACT_FRICTION = 0.2
CONTACT_RESTITUTION = 0.0

TOUCH_DECAY = 0.8
"""Factor per step of a touch sensor's value while its cell touches no wall."""

LIGHT_RADIUS = 1.0
BALL_RADIUS = 1.0
BALL_DENSITY = 0.1
BALL_DRAG = 1.0
"""Drag force on the ball per unit of speed."""
TARGET_SIDE = 10.0
"""Side of the square target area, which collides with nothing."""

JOINT_TORQUE = 162_000.0
"""Maximum torque with which a joint holds a wheel of the jointed construction in place."""

MAX_TRANSLATION = 2.0
"""Maximum translation of a body in one step, in units (Box2D's limit)."""
MAX_ROTATION_RAD = 0.5 * np.pi
"""Maximum rotation of a body in one step, in radians (Box2D's limit)."""

STABILITY_TOLERANCE = 1e-9
"""Excess of a step's spectral radius over 1 beyond which wheel friction is made implicit."""


_Vector = tuple[float, float, float]
_Rows = tuple[_Vector, _Vector, _Vector]


@dataclass(frozen=True)
class WheelModel:
    """The wheels of one body as linear maps in the body frame, about the centre of mass.

    With the twist ``u = (v_x, v_y, omega)`` and the gas ``g`` of each wheel, the explicit wrench
    is ``thrust @ g - damping @ u``.
    """

    hull_density: float
    """Density of all cells but the wheels."""
    mass_properties: MassProperties
    wheel_cells: NDArray[np.intp]
    """Flat grid indices of the wheels, row by row, shape ``(wheels,)``."""
    thrust: NDArray[np.float64]
    """Wrench per unit of gas, shape ``(3, wheels)``."""
    damping: NDArray[np.float64]
    """Wrench per unit of twist, shape ``(3, 3)``, positive semidefinite."""
    implicit: bool
    """True if friction is integrated implicitly, because explicit friction would gain energy."""
    solver: NDArray[np.float64]
    """Map from the explicit wrench to the applied one, shape ``(3, 3)``; identity if explicit."""

    def wrench(self, gas: NDArray[np.float64], twist: _Vector) -> _Vector:
        """Compute force x, force y and torque of all wheels over the next step, body frame.

        Args:
            gas: Gas of each wheel in [-1, 1], shape ``(wheels,)``.
            twist: Velocity ``(v_x, v_y, omega)`` of the centre of mass at the start of the step,
                body frame.
        """
        t_x, t_y, t_turn = self.thrust.dot(gas).tolist()  # faster than @
        d_x, d_y, d_turn = _product(self._damping_rows, twist)
        explicit = (t_x - d_x, t_y - d_y, t_turn - d_turn)
        return _product(self._solver_rows, explicit) if self.implicit else explicit

    @cached_property
    def _damping_rows(self) -> _Rows:
        return _rows(self.damping)

    @cached_property
    def _solver_rows(self) -> _Rows:
        return _rows(self.solver)


def _rows(matrix: NDArray[np.float64]) -> _Rows:
    first, second, third = (tuple(row) for row in matrix.tolist())
    return first, second, third


def _product(rows: _Rows, vector: _Vector) -> _Vector:
    """Multiply a small matrix, faster than numpy does."""
    x, y, z = vector
    (a, b, c), (d, e, f), (g, h, i) = rows
    return a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z


def wheel_model(body: BodyGrid, hull_density: float = HULL_DENSITY) -> WheelModel:
    """Build the wheel model of a body with at least one cell.

    Explicit friction multiplies the twist by ``1 - dt M^-1 D`` each step, with
    ``M = diag(m, m, I)``. If the spectral radius of this matrix exceeds 1, friction is implicit
    instead: ``(M + dt D) u' = M u + dt T g``. The wrench that takes ``u`` to ``u'`` is
    ``M (M + dt D)^-1`` times the explicit wrench; ``solver`` holds this matrix.
    """
    properties = mass_properties(body, hull_density)
    wheel_cells = np.flatnonzero(wheel_mask(body))
    points = cell_centers(body.shape[0]).reshape(-1, 2)[wheel_cells] - properties.center
    x, y = points[:, 0], points[:, 1]
    ones, zeros = np.ones_like(x), np.zeros_like(x)
    # Rows of the Jacobians that map the twist to a wheel's speed along each of its axes.
    forward = np.stack([zeros, ones, x], axis=0)
    side = np.stack([ones, zeros, -y], axis=0)
    damping = WHEEL_FORWARD_FRICTION * forward @ forward.T + WHEEL_SIDE_FRICTION * side @ side.T
    inertia = np.diag([properties.mass, properties.mass, properties.inertia])
    rates = np.linalg.eigvals(np.linalg.solve(inertia, damping)).real
    implicit = bool(np.max(np.abs(1.0 - DT * rates)) > 1.0 + STABILITY_TOLERANCE)
    solver = inertia @ np.linalg.inv(inertia + DT * damping) if implicit else np.eye(3)
    return WheelModel(
        hull_density=hull_density,
        mass_properties=properties,
        wheel_cells=wheel_cells,
        thrust=WHEEL_THRUST * forward,
        damping=damping,
        implicit=implicit,
        solver=solver,
    )
