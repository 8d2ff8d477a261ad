"""The way back: from a body to a genome that grows it, by gradient descent on growth."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional
from torch.nn.utils import clip_grad_norm_

from ncrs.automaton.channels import (
    ALIVE_THRESHOLD,
    BODY_CHANNEL,
    CONTROL_CHANNEL,
    HIDDEN_UNITS,
    KERNEL_SIZE,
    STATE_LIMIT,
    NCALayout,
    growth_steps,
    nca_layout,
)
from ncrs.automaton.growth import alive_cells, read_body, seed_state
from ncrs.automaton.torch_settings import one_torch_thread
from ncrs_envs.body import parse_body
from ncrs_envs.errors import NCRSError
from ncrs_envs.tasks import Task

GROWTH_UNITS = (10, 18)
"""Default number of units of the first and of the second layer that grow the body; the others are
for control."""
_MARGIN = 0.7
_LEARNING_RATE = 5e-3
_GRADIENT_NORM = 0.5
_STEPS = 1500
_ATTEMPTS = 4


class GrowthError(NCRSError, RuntimeError):
    """A body for which no genome was found."""


def grow_to(
    body: Any,
    task: str | Task = "light_chase",
    *,
    units: tuple[int, int] = GROWTH_UNITS,
    seed: int = 0,
) -> NDArray[np.float32]:
    """Find a genome that grows a given body.

    Only the last ``units`` of the two hidden layers have weights. They are silent while the robot
    drives, so that it stands still until other units get weights, from a search or a ``Circuit``,
    whose genome can be added to this one. A body that is its own mirror image gets a symmetric
    genome (``NCALayout.symmetric``). Takes about a second for 5 x 5 cells, and up to a minute for
    9 x 9.

    Args:
        body: Body in any form that ``parse_body`` reads; it may have several pieces.
        task: Task or its name, for which the body is valid.
        units: Number of units of the first and of the second layer to use, each 1 to 30.
        seed: Seed of the first weights.

    Returns:
        The genome, float32 ``(num_parameters,)``.

    Raises:
        BodyError: The body is malformed, or not valid for the task.
        TaskError: The task is unknown.
        GrowthError: ``units`` is out of range, or there was no such genome to be found.
    """
    layout, grid = nca_layout(task), parse_body(body)
    layout.task.check_body(grid)
    if len(units) != 2 or not all(1 <= count <= HIDDEN_UNITS for count in units):
        raise GrowthError(f"units must be two numbers from 1 to {HIDDEN_UNITS}, got {units!r}.")
    with one_torch_thread(), torch.inference_mode(False), torch.enable_grad():
        for attempt in range(_ATTEMPTS):
            generator = torch.Generator().manual_seed(seed * _ATTEMPTS + attempt)
            found = _Growing(layout, grid, units, generator).descend()
            if found is not None:
                return found
    raise GrowthError(
        f"No genome that grows this body was found in {_ATTEMPTS} attempts; use more of the "
        f"{HIDDEN_UNITS} units of each layer than {units}, or another seed."
    )


class _Growing:
    """Weights under training, and the distance of what they grow from a body."""

    def __init__(
        self,
        layout: NCALayout,
        body: NDArray[np.int8],
        units: tuple[int, int],
        generator: torch.Generator,
    ) -> None:
        self._layout, self._body = layout, body
        first, second = self._units = units
        channels = layout.channels

        def drawn(shape: tuple[int, ...], inputs: int) -> Tensor:
            values = torch.rand(shape, generator=generator, dtype=torch.float32, device="cpu")
            return ((2 * values - 1) / math.sqrt(inputs)).requires_grad_()

        inputs = channels * KERNEL_SIZE**2
        self._weights = [
            drawn((first, channels, KERNEL_SIZE, KERNEL_SIZE), inputs),
            drawn((first,), inputs),
            drawn((second, first, 1, 1), first),
            drawn((channels, second, 1, 1), second),
            drawn((channels,), second),
        ]
        self._is_mirrored = np.array_equal(body, body[:, ::-1])
        self._updated = torch.ones((channels, 1, 1), dtype=torch.float32, device="cpu")
        self._updated[CONTROL_CHANNEL] = 0.0
        # The second layer has no bias, and what changes during control none in the third: with the
        # first layer silent, nothing changes.
        self._biased = torch.ones(channels, dtype=torch.float32, device="cpu")
        self._biased[layout.changing_channels] = 0.0
        codes = np.array(layout.part_codes)[:, None, None]
        self._parts = torch.from_numpy(codes == body)
        self._occupied = torch.from_numpy(body != 0)

    def _layers(self) -> list[Tensor]:
        reading, *others, bias = self._weights
        if self._is_mirrored:
            reading = 0.5 * (reading + reading.flip(-1))
        return [reading, *others, bias * self._biased]

    def descend(self) -> NDArray[np.float32] | None:
        """Descend until the body grows with a margin; None if it does not in time."""
        optimizer = torch.optim.Adam(self._weights, lr=_LEARNING_RATE)
        for _ in range(_STEPS):
            loss, worst, grown = self._distance()
            if worst < _MARGIN / 2 and np.array_equal(grown, self._body):
                return self._genome()
            optimizer.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            clip_grad_norm_(self._weights, _GRADIENT_NORM)
            optimizer.step()
        return None

    def _distance(self) -> tuple[Tensor, float, NDArray[np.int8]]:
        """Return the loss, the largest violation of a margin, and the body that grows."""
        reading, bias1, middle, writing, bias3 = self._layers()
        size = len(self._body)
        state = seed_state(self._layout.channels, size)[None]
        histories = []
        for _ in range(growth_steps(size)):
            alive = alive_cells(state)
            hidden = functional.relu(functional.conv2d(state, reading, bias1, padding=1))
            hidden = functional.relu(functional.conv2d(hidden, middle))
            change = functional.conv2d(hidden, writing, bias3) * self._updated
            state = (state + change).clamp(-STATE_LIMIT, STATE_LIMIT) * alive
            histories.append(state[0, BODY_CHANNEL])
        values, parts = state[0, BODY_CHANNEL], state[0, self._layout.part_channels]
        full, none = ALIVE_THRESHOLD + _MARGIN, ALIVE_THRESHOLD - _MARGIN
        lacking = functional.relu(torch.where(self._occupied, full - values, values - none))
        is_alive = alive[0, 0]
        lacking = lacking * (is_alive | self._occupied)  # a dead cell is empty for certain
        own = (parts * self._parts).sum(0)
        others = parts.masked_fill(self._parts, -torch.inf).amax(0)
        mistaken = functional.relu(_MARGIN - (own - others)) * self._occupied
        loss = lacking.mean() + mistaken.mean()
        if bool((self._occupied & ~is_alive).any()):
            # No gradient reaches a cell that is not alive: let the robot fill the grid on its way.
            filling = [functional.relu(full - values).mean() for values in histories[:-1]]
            loss = loss + torch.stack(filling).mean()
        worst = float(torch.maximum(lacking, mistaken).max().detach())
        return loss, worst, read_body(state, self._layout)[0]

    def _genome(self) -> NDArray[np.float32]:
        first, second = self._units
        layout = self._layout
        genome: NDArray[np.float32] = np.zeros((1, layout.num_parameters), dtype=np.float32)
        reading, bias1, middle, _, writing, bias3 = (part[0] for part in layout.layers(genome))
        found = [layer.detach().numpy() for layer in self._layers()]
        reading[-first:], bias1[-first:], middle[-second:, -first:] = found[:3]
        writing[:, -second:], bias3[:] = found[3:]
        # Silence during control, when the flag is 1, whatever the states are.
        highest = STATE_LIMIT * np.abs(found[0]).sum((1, 2, 3)) + np.maximum(found[1], 0)
        middle_cell = KERNEL_SIZE // 2
        reading[-first:, CONTROL_CHANNEL] = 0
        reading[-first:, CONTROL_CHANNEL, middle_cell, middle_cell] = -highest - 1
        return genome.reshape(-1)
