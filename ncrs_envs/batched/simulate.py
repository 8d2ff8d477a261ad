"""One robot in one run: reset and step. The interface that batched callers use.

Every kernel works on one run and touches only the arrays it is given, so callers may spread runs
over threads as they like; results do not depend on how. Nothing is allocated inside a step.

Arrays, with ``n`` the grid size (``layout`` says what lies where):

- ``settings``: float64 ``(SETTINGS_SIZE,)``, from ``records.settings_array``; one for all.
- ``robot``: float64 ``(robot_size(n),)`` and ``cells``: int32 ``(cells_size(n),)``, both filled by
  ``robot.prepare_robot(body, robot, cells)``; one for all runs of a body.
- ``scenario``: float64 ``(scenario_size(quads),)``, a row of ``records.scenario_arrays``.
- ``state``: float64 ``(STATE_SIZE,)``, one for each run.
- ``scratch``: float64 ``(scratch_size(n),)``, contents meaningless between calls; one for each
  thread is enough.
- ``action`` and ``observation``: flat grids ``(n * n,)`` of float32 or float64, row by row.

A run is ``reset_run(...)``, then ``step_run(...)`` as often as needed. Success, crossed and
touched are read from the state.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.contacts import move_with_contacts
from ncrs_envs.batched.dynamics import apply_drag, apply_wheels
from ncrs_envs.batched.layout import (
    ROBOT_CENTER_X,
    ROBOT_CENTER_Y,
    SCENARIO_SEEN_X,
    SCENARIO_SEEN_Y,
    SCENARIO_START_X,
    SCENARIO_START_Y,
    SETTING_HAS_BALL,
    STATE_BALL_X,
    STATE_BALL_Y,
    STATE_CLOSEST,
    STATE_COS,
    STATE_SIZE,
    STATE_X,
    STATE_Y,
)
from ncrs_envs.batched.sensing import score, sense


@kernel
def reset_run(
    settings: NDArray[np.float64],
    robot: NDArray[np.float64],
    cells: NDArray[np.int32],
    scenario: NDArray[np.float64],
    state: NDArray[np.float64],
    observation: NDArray[np.floating],
) -> None:
    """Place robot and ball as the scenario says, at rest, and write the first observation."""
    for i in range(STATE_SIZE):
        state[i] = 0.0
    state[STATE_X] = scenario[SCENARIO_START_X] + robot[ROBOT_CENTER_X]
    state[STATE_Y] = scenario[SCENARIO_START_Y] + robot[ROBOT_CENTER_Y]
    state[STATE_COS] = 1.0
    state[STATE_CLOSEST] = np.inf
    state[STATE_CLOSEST + 1] = np.inf
    if settings[SETTING_HAS_BALL] != 0.0:
        state[STATE_BALL_X] = scenario[SCENARIO_SEEN_X]
        state[STATE_BALL_Y] = scenario[SCENARIO_SEEN_Y]
    for place in range(observation.shape[0]):
        observation[place] = 0.0
    sense(settings, robot, cells, scenario, state, observation)


@kernel
def step_run(
    settings: NDArray[np.float64],
    robot: NDArray[np.float64],
    cells: NDArray[np.int32],
    scenario: NDArray[np.float64],
    state: NDArray[np.float64],
    scratch: NDArray[np.float64],
    action: NDArray[np.floating],
    observation: NDArray[np.floating],
) -> float:
    """Advance one step of ``DT`` seconds and return the reward.

    Args:
        settings: the task's settings.
        robot: the robot's record.
        cells: the robot's indices.
        scenario: the run's scenario.
        state: the run's state, changed.
        scratch: room for the contact solver.
        action: finite gas per cell; read in wheel cells, clipped to [-1, 1].
        observation: output; only sensor cells are written.
    """
    apply_wheels(robot, cells, state, action)
    if settings[SETTING_HAS_BALL] != 0.0:
        apply_drag(state)
    move_with_contacts(settings, robot, cells, scenario, state, scratch)
    sense(settings, robot, cells, scenario, state, observation)
    return score(settings, robot, scenario, state)
