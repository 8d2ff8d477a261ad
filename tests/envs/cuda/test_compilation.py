"""The kernels of the environments compile for GPUs that are not here, within known bounds."""

import numpy as np
import pytest

pytest.importorskip("numba_cuda", reason="needs the extra cuda")

from ncrs_envs.batched.dtypes import records
from ncrs_envs.batched.layout import Contact, Settings, State, make_robots, make_scenarios
from ncrs_envs.batched.sampling import MAX_QUADS, MAX_VERTICES, Room, Walls
from ncrs_envs.batched.streams import STREAM_SIZE
from ncrs_envs.cuda import kernels
from ncrs_envs.cuda.gpu import MAX_REGISTERS
from tests.ptx import compiled

MAX_SPILLED = {"scatter": 0, "start_envs": 0, "step_envs": 600}
"""Bytes of registers that a kernel stores in memory; measured: 0, 0, and 388 (8.0)."""


def arguments(name):
    """Return arguments of a kernel, for their types."""
    n, count, capacity = 5, 2, 80
    if name == "scatter":
        words = np.zeros((count, 3), np.uint64)
        return np.zeros(count, np.int64), words, words
    fleet = kernels.Fleet(
        records(Settings, 1),
        make_robots(count, n),
        make_scenarios(count, MAX_QUADS),
        records(State, count),
        records(Contact, count, capacity),
        np.zeros((count, STREAM_SIZE), np.uint64),
        Walls(
            np.zeros((count, 2), np.int64),
            np.zeros((count, 2, MAX_VERTICES, 2)),
            np.zeros((count, MAX_QUADS, 4, 2)),
        ),
        np.zeros(1, np.int64),
    )
    flags, cells = np.zeros(count, np.bool_), np.zeros((count, n * n), np.float32)
    readings = kernels.Readings(cells, np.zeros((count, 3)), np.zeros((count, 2)), flags, flags)
    turn = kernels.Turn(cells, np.zeros(count), flags, flags, flags, np.zeros(count, np.int64))
    rules = kernels.Rules(Room(n, 60.0, 0.1), True, 100, False, False)
    if name == "start_envs":
        what = (np.zeros(count, np.int8), np.zeros(count, np.int64))
        return fleet, readings, turn, rules, what
    return fleet, readings, readings, turn, rules


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.slow) if name == "step_envs" else name
        for name in MAX_SPILLED
    ],
)
def test_a_kernel_compiles_within_its_bounds(name):
    for capability, (ptx, used, spilled) in compiled(
        getattr(kernels, name), arguments(name)
    ).items():
        assert f".target sm_{capability[0]}{capability[1]}" in ptx
        assert 8 < used <= MAX_REGISTERS
        assert spilled <= MAX_SPILLED[name]
