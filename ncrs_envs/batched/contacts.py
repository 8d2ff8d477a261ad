"""Motion of robot and ball over one step with what they run into."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.dynamics import limit_speeds, move_ball, move_robot
from ncrs_envs.batched.layout import SETTING_HAS_BALL
from ncrs_envs.physics import DT


@kernel
def move_with_contacts(
    settings: NDArray[np.float64],
    robot: NDArray[np.float64],
    cells: NDArray[np.int32],
    scenario: NDArray[np.float64],
    state: NDArray[np.float64],
    scratch: NDArray[np.float64],
) -> None:
    """Move robot and ball for one step."""
    limit_speeds(state)
    move_robot(state, DT)
    if settings[SETTING_HAS_BALL] != 0.0:
        move_ball(state)


def scratch_size(grid_size: int) -> int:
    """Length of the contact solver's scratch array."""
    return 16 * grid_size
