"""The kernels of the engine ``cuda`` compile for GPUs that are not here, within known bounds."""

import numpy as np
import pytest

pytest.importorskip("numba_cuda", reason="needs the extra cuda")

from ncrs.automaton.channels import nca_layout
from ncrs.engines.cuda import layout
from ncrs.engines.cuda.growth import make_growth_kernel, prepare_robots
from ncrs.engines.cuda.rollout import roll_out
from ncrs_envs.batched.dtypes import records
from ncrs_envs.batched.layout import (
    Contact,
    Scenarios,
    Settings,
    State,
    make_robots,
    make_scenarios,
)
from ncrs_envs.cuda.gpu import MAX_REGISTERS
from tests.ptx import compiled

MAX_SPILLED = {"grow_population": 0, "prepare_robots": 0, "roll_out": 1400}
"""Bytes of registers that a kernel stores in memory; measured: 0, 0 and 932 (9.0)."""


def _arguments():
    n, robots, episodes, capacity = 5, 2, 12, 80
    genomes = layout.Genomes(
        np.zeros((robots, nca_layout("obstacle").num_parameters), np.float32),
        np.zeros(3, np.int8),
        np.zeros((robots, n, n), np.int8),
        np.zeros(robots, np.bool_),
    )
    rows = make_scenarios(episodes, 4)
    scenarios = Scenarios(rows.scenarios[None], rows.quads[None])
    courses = layout.Courses(
        np.zeros(robots, np.int64),
        make_robots(robots, n),
        records(Settings, 1),
        scenarios,
        100,
        12,
        3,
    )
    buffers = layout.Buffers(
        records(layout.Outcome, robots, episodes),
        records(State, robots, episodes),
        records(layout.Move, robots, episodes),
        records(Contact, robots, episodes, capacity),
    )
    return genomes, courses, buffers


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.slow) if name == "roll_out" else name
        for name in MAX_SPILLED
    ],
)
def test_a_kernel_compiles_within_its_bounds(name):
    genomes, courses, buffers = _arguments()
    kernel, arguments = {
        "grow_population": (make_growth_kernel(12), (genomes, 10)),
        "prepare_robots": (prepare_robots, (genomes, courses)),
        "roll_out": (roll_out, (genomes, courses, buffers)),
    }[name]
    for capability, (ptx, used, spilled) in compiled(kernel, arguments).items():
        assert f".target sm_{capability[0]}{capability[1]}" in ptx
        assert 32 < used <= MAX_REGISTERS
        assert spilled <= MAX_SPILLED[name]
