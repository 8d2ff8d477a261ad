"""Constants, colours and placements that pages need to draw a task, and to run it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ncrs.automaton.channels import growth_steps, nca_layout
from ncrs.automaton.regrow_to import REPAIR_STEPS
from ncrs.engines.nca_kernels import CHANGING_CHANNELS
from ncrs_envs import canvas
from ncrs_envs.batched.layout import make_scratch
from ncrs_envs.body import CELL_CHARACTERS, CELL_SIZE, SENSOR_CELLS, Cell
from ncrs_envs.perturbations import GROWTH_PER_STEP
from ncrs_envs.physics import BALL_RADIUS, DT, LIGHT_RADIUS, TARGET_SIDE
from ncrs_envs.scenario import WALL_EXTENT, Scenario, wall_quads
from ncrs_envs.tasks import MAX_EPISODE_STEPS, TaskSettings, playfield

_COLORS: Mapping[str, canvas.Color] = {
    "amber": canvas.AMBER,
    "sky": canvas.SKY,
    "rose": canvas.ROSE,
    "green": canvas.GREEN,
    "vermilion": canvas.VERMILION,
    "white": canvas.WHITE,
    "ground": canvas.GROUND,
    "grid": canvas.GRID,
    "border": canvas.BORDER,
    "wall": canvas.WALL,
    "wall_edge": canvas.WALL_EDGE,
    "tissue": canvas.TISSUE,
    "cell_edge": canvas.CELL_EDGE,
    "sensor_base": canvas.SENSOR_BASE,
    "wheel_base": canvas.WHEEL_BASE,
}
_PLACEMENT_DECIMALS = 2
"""Number of decimals that are kept of placements, in units."""


def world(settings: TaskSettings, scenarios: Sequence[Scenario]) -> dict[str, Any]:
    """Collect the constants and placements that a page needs to draw episodes."""
    task = settings.task
    return {
        "task": task.name,
        "title": task.title,
        "gridSize": settings.grid_size,
        "extent": playfield(settings.grid_size),
        "wallExtent": WALL_EXTENT,
        "successRadius": settings.radius,
        "distanceScore": settings.distance_score,
        "hasBall": task.has_ball,
        "lightRadius": LIGHT_RADIUS,
        "ballRadius": BALL_RADIUS,
        "targetSide": TARGET_SIDE,
        "cellSize": CELL_SIZE,
        "dt": DT,
        "steps": MAX_EPISODE_STEPS,
        "channels": nca_layout(task).channel_names,
        "cells": {
            character: {
                "code": int(cell),
                "name": task.cell_label(cell),
                "senses": cell in SENSOR_CELLS,
                "drives": cell is Cell.WHEEL,
            }
            for character, cell in CELL_CHARACTERS.items()
        },
        "palette": {name: f"rgb{color}" for name, color in _COLORS.items()},
        "scales": {"amount": canvas.AMOUNTS, "signed": canvas.SIGNED},
        "signedLimit": canvas.SIGNED_LIMIT,
        "scenarios": [placements(scenario, settings.grid_size) for scenario in scenarios],
    }


def live_world(settings: TaskSettings, scenarios: Sequence[Scenario]) -> dict[str, Any]:
    """Collect what a page needs to run robots too; placements are rounded."""
    return {
        **world(settings, scenarios),
        "growthSteps": growth_steps(settings.grid_size),
        "repairSteps": REPAIR_STEPS,
        "growthPerStep": GROWTH_PER_STEP,
        "partCodes": list(nca_layout(settings.task).part_codes),
        "changingChannels": CHANGING_CHANNELS,
        "contactCapacity": len(make_scratch(settings.grid_size).contacts),
        "hasWalls": settings.task.has_walls,
        "required": [[int(cell), count] for cell, count in settings.task.required_parts],
        "parameters": nca_layout(settings.task).num_parameters,
    }


def placements(
    scenario: Scenario, grid_size: int, decimals: int | None = _PLACEMENT_DECIMALS
) -> dict[str, Any]:
    """Return a scenario's placements and its walls as quads; decimals are all kept for None."""
    quads = wall_quads(scenario, grid_size)
    return {
        "light": scenario.light,
        "ball": scenario.ball,
        "target": scenario.target,
        "start": scenario.start,
        "walls": (quads if decimals is None else np.round(quads, decimals)).tolist(),
    }
