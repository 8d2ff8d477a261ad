"""From a body to a genome that grows it, and regrows what it loses, by gradient descent."""

from __future__ import annotations

import math
from itertools import combinations
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ncrs.automaton.channels import NCALayout, nca_layout
from ncrs.automaton.grow_to import Descent, GrowthError
from ncrs.automaton.growth import standing_state
from ncrs.automaton.torch_settings import one_torch_thread
from ncrs_envs.body import BodyGrid, Cell, parse_body
from ncrs_envs.perturbations import ROUNDING, Damage, Repair, check_share
from ncrs_envs.tasks import Task

REPAIR_UNITS = (14, 22)
"""Default number of units of the first and of the second layer that grow and repair the body; the
others are for control."""
REPAIR_STEPS = 10
"""Default number of growth steps of a repair."""
REPAIR_FRACTION = 0.5
"""Default largest fraction of the modules that come back."""
_STEPS = 6000
_DAMAGES = 256
"""Largest number of damages in training."""


def regrow_to(
    body: Any,
    task: str | Task = "light_chase",
    *,
    steps: int = REPAIR_STEPS,
    fraction: float = REPAIR_FRACTION,
    seed: int = 0,
) -> NDArray[np.float32]:
    """Find a genome that grows a given body, and regrows it from what damage leaves.

    As ``grow_to`` does, it uses the last units of the two hidden layers, ``REPAIR_UNITS`` here. It
    is trained on all damages of up to that fraction of the modules, or on 256 of them if there are
    more. Takes about half a minute for eight modules.

    Args:
        body: Body in any form that ``parse_body`` reads.
        task: Task or its name, for which the body is valid.
        steps: Number of growth steps in which it regrows, see ``ncrs_envs.Repair``.
        fraction: Largest fraction of the modules that it regrows, rounded up; one always stays.
        seed: Seed of the first weights, and of the damages.

    Returns:
        The genome, float32 ``(num_parameters,)``.

    Raises:
        BodyError: The body is malformed, or not valid for the task.
        TaskError: The task is unknown.
        PerturbationError: ``steps`` or ``fraction`` is out of range.
        GrowthError: There was no such genome to be found.
    """
    layout, grid = nca_layout(task), parse_body(body)
    layout.task.check_body(grid)
    repair, share = Repair(steps), check_share(fraction, "fraction")
    left = damaged_bodies(grid, share, np.random.default_rng(seed))
    with one_torch_thread(), torch.inference_mode(False), torch.enable_grad():
        found = _RepairDescent(layout, grid, [grid, *left], repair.steps, seed).descend(_STEPS)
    if not found.are_exact[0]:
        raise GrowthError(
            f"No genome that regrows this body in {steps} steps was found; give it more steps, or "
            "another seed."
        )
    genome: NDArray[np.float32] = found.genomes[0]
    return genome


def damaged_bodies(
    body: BodyGrid, fraction: float, generator: np.random.Generator
) -> list[BodyGrid]:
    """List what damages of up to a fraction of the modules leave of a body, at most 256 of them.

    Args:
        body: Cell codes, shape ``(n, n)``.
        fraction: Largest fraction of the modules, rounded up; one always stays.
        generator: Generator that chooses, if there are more.
    """
    cells = [(row, column) for row, column in np.argwhere(body != Cell.EMPTY).tolist()]
    most = min(math.ceil(fraction * len(cells) - ROUNDING), len(cells) - 1)
    counts = range(1, most + 1)
    if sum(math.comb(len(cells), count) for count in counts) <= _DAMAGES:
        chosen = [lost for count in counts for lost in combinations(cells, count)]
    else:
        orders = [generator.permutation(len(cells)) for _ in range(_DAMAGES)]
        chosen = [
            tuple(cells[place] for place in order[: 1 + index % most])
            for index, order in enumerate(orders)
        ]
    return [Damage(0, lost).left(body) for lost in chosen]


class _RepairDescent(Descent):
    """Weights under training to grow one body, and to regrow it from several that stand."""

    def __init__(
        self, layout: NCALayout, body: BodyGrid, standing: list[BodyGrid], steps: int, seed: int
    ) -> None:
        generator = torch.Generator().manual_seed(seed)
        super().__init__(layout, body[None], REPAIR_UNITS, generator)
        self._standing = torch.stack([standing_state(remains, layout) for remains in standing])
        self._repair_steps = steps

    def _distances(
        self, layers: list[Tensor]
    ) -> tuple[Tensor, NDArray[np.float32], NDArray[np.int8]]:
        losses, worst, grown = super()._distances(layers)
        count = len(self._standing)
        shared = [layer.expand(count, *layer.shape[1:]) for layer in layers]
        others = self._distances_from(self._standing, self._repair_steps, shared)
        whole = np.concatenate([grown, others[2]])
        wrong = (whole != self._bodies).any(axis=(1, 2))
        return (
            losses + others[0].mean(),
            np.maximum(worst, others[1].max()),
            whole[np.argmax(wrong)][None],
        )
