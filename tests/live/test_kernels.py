"""The kernels that only the page calls, as plain Python."""

import numpy as np
import pytest

from ncrs.automaton.channels import nca_layout
from ncrs.engines.nca_kernels import GROWTH_LANES, pack_genomes, seed_lanes
from ncrs.live import kernels
from ncrs_envs.batched.dtypes import records
from ncrs_envs.batched.layout import Robot, State
from ncrs_envs.batched.perturbations import exchange_robot


@pytest.mark.parametrize("task", ["light_chase", "carry_ball"])
def test_one_genome_is_laid_out_as_a_population_is(task):
    layout = nca_layout(task)
    genome = np.random.default_rng(1).normal(size=layout.num_parameters).astype(np.float32)
    fixed = layout.changing_channels.start
    pack = kernels._pack.py_func
    for expected, first, lanes in zip(
        pack_genomes(genome[None], layout), (0, fixed), (GROWTH_LANES, 8), strict=True
    ):
        for mine, theirs in zip(pack(genome, layout.channels, first, lanes), expected, strict=True):
            np.testing.assert_array_equal(mine, theirs[0])


def test_a_cell_of_a_growing_body_is_emptied_or_replaced():
    states = seed_lanes.py_func(3)
    states[4] = 0.5
    kernels.set_growing_cell.py_func(states, 4, 1)
    assert np.flatnonzero(states[4, 0]).tolist() == [0, 3]
    kernels.set_growing_cell.py_func(states, 4, -1)
    assert not states.any()


def test_another_body_keeps_the_grids_place_and_motion():
    before, after = records(Robot, 2)
    before.center_x, before.center_y = 1.0, 0.5
    after.center_x, after.center_y = -0.5, 2.0
    (state,) = records(State, 1)
    state.x, state.y, state.omega, state.vx = 3.0, -2.0, 4.0, 1.0
    state.cos, state.sin = 0.6, 0.8

    def grid():
        robot = after if moved else before
        x = robot.center_x * state.cos - robot.center_y * state.sin
        y = robot.center_x * state.sin + robot.center_y * state.cos
        place = (state.x - x, state.y - y)
        return place, (state.vx + state.omega * y, state.vy - state.omega * x)

    moved = False
    expected = grid()
    exchange_robot.py_func(before, after, state)
    moved = True
    np.testing.assert_allclose(grid(), expected)
    assert state.clearance == 0.0
