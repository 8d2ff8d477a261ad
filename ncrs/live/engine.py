"""The engine in JavaScript: the kernels of automaton and physics, translated from their source."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

from ncrs.engines.brain_kernels import inherit_states, make_brain, regrow
from ncrs.engines.nca_kernels import growth_step, read_grown, seed_lanes
from ncrs.live.kernels import (
    link_grid,
    live_step,
    pack_control,
    pack_growth,
    set_growing_cell,
)
from ncrs.live.translate import Entry, Program
from ncrs_envs.batched import layout
from ncrs_envs.batched.dynamics import grid_center
from ncrs_envs.batched.perturbations import exchange_robot
from ncrs_envs.batched.records import prepare_walls
from ncrs_envs.batched.robot import prepare_robot
from ncrs_envs.batched.sensing import distances, sense
from ncrs_envs.batched.simulate import reset_episode, step_episode

NAME = "NCRSEngine"
"""Name of the object that holds the translated functions."""

_GROWN = {"states": 3}
_BRAINS = {
    f"{name}.{field}": 3 for name in ("brain", "before", "after") for field in ("states", "updated")
}
ENTRIES = (
    Entry(pack_growth),
    Entry(pack_control),
    Entry(link_grid),
    Entry(seed_lanes),
    Entry(growth_step, {**_GROWN, "updated": 3}),
    Entry(read_grown, {**_GROWN, "body": 2}),
    Entry(set_growing_cell, _GROWN),
    Entry(make_brain, {"body": 2}),
    Entry(inherit_states, _BRAINS),
    Entry(regrow, {"body": 2, "grown": 2}),
    Entry(prepare_robot, {"body": 2}),
    Entry(prepare_walls, {"walls": 3}),
    Entry(reset_episode),
    Entry(live_step, {**_BRAINS, "observations": 2}),
    Entry(step_episode),
    Entry(exchange_robot),
    Entry(sense),
    Entry(distances),
    Entry(grid_center),
)
"""Functions that the page calls."""
_RECORDS = (
    layout.Settings,
    layout.Robot,
    layout.Wheel,
    layout.Sensor,
    layout.Point,
    layout.Scenario,
    layout.Quad,
    layout.State,
    layout.Contact,
)
"""Records that the page makes."""


@cache
def engine_code() -> str:
    """Return the script that defines the engine.

    Raises:
        TranslationError: If a kernel holds a construct that the translator does not know.
    """
    program = Program()
    names = [program.add(entry).name for entry in ENTRIES]
    names += [program.record(kind) for kind in _RECORDS]
    runtime = (files("ncrs.live") / "page" / "runtime.js").read_text(encoding="utf-8")
    exported = ", ".join([*names, "newGrid"])
    return (
        f"const {NAME} = (() => {{\n{runtime}\n{program.code()}\nreturn {{ {exported} }};\n}})();\n"
    )
