"""The way back: from bodies to genomes that grow them, by gradient descent on growth."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

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
_MOMENTS = (0.9, 0.999)
"""Decay of the means of gradients and of their squares (Adam: Kingma and Ba 2015)."""
_TINY = 1e-8
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
    for attempt in range(_ATTEMPTS):
        found = grow_each(grid[None], layout, units, seed * _ATTEMPTS + attempt, _STEPS)
        if found.are_exact[0]:
            genome: NDArray[np.float32] = found.genomes[0]
            return genome
    raise GrowthError(
        f"No genome that grows this body was found in {_ATTEMPTS} attempts; use more of the "
        f"{HIDDEN_UNITS} units of each layer than {units}, or another seed."
    )


class GrownGenomes(NamedTuple):
    """Genomes for given bodies."""

    genomes: NDArray[np.float32]
    """Genomes, ``(B, num_parameters)``."""
    are_exact: NDArray[np.bool_]
    """True for those that grow their body with a margin; others came near, or did not, ``(B,)``."""


def grow_each(
    bodies: NDArray[np.int8],
    layout: NCALayout,
    units: tuple[int, int],
    seed: int,
    steps: int,
) -> GrownGenomes:
    """Descend towards genomes that grow valid bodies, for all of them at the same time.

    Args:
        bodies: Cell codes, ``(B, n, n)``.
        layout: Channels of the automaton.
        units: As in ``grow_to``.
        seed: Seed of the first weights of all.
        steps: Maximum number of steps.
    """
    generator = torch.Generator().manual_seed(seed)
    with one_torch_thread(), torch.inference_mode(False), torch.enable_grad():
        return Descent(layout, bodies, units, generator).descend(steps)


class Descent:
    """Weights under training, and the distances of what they grow from the bodies."""

    def __init__(
        self,
        layout: NCALayout,
        bodies: NDArray[np.int8],
        units: tuple[int, int],
        generator: torch.Generator,
    ) -> None:
        self._layout, self._units = layout, units
        channels, (first, second) = layout.channels, units

        def drawn(rows: int, columns: int, inputs: int) -> Tensor:
            shape = (len(bodies), rows, columns)
            values = torch.rand(shape, generator=generator, dtype=torch.float32, device="cpu")
            return (2 * values - 1) / math.sqrt(inputs)

        inputs = channels * KERNEL_SIZE**2
        self._weights = [
            drawn(first, inputs, inputs),
            drawn(first, 1, inputs),
            drawn(second, first, first),
            drawn(channels, second, second),
            drawn(channels, 1, second),
        ]
        self._moments = [[torch.zeros_like(weights) for weights in self._weights] for _ in _MOMENTS]
        self._updated = torch.ones((channels, 1), dtype=torch.float32, device="cpu")
        self._updated[CONTROL_CHANNEL] = 0.0
        # The second layer has no bias, and what changes during control none in the third: with the
        # first layer silent, nothing changes.
        self._biased = torch.ones((channels, 1), dtype=torch.float32, device="cpu")
        self._biased[layout.changing_channels] = 0.0
        self._aim_at(np.arange(len(bodies)), bodies)

    def _aim_at(self, owners: NDArray[np.int64], bodies: NDArray[np.int8]) -> None:
        """Train the weights of these owners for their bodies."""
        self._owners, self._bodies = owners, bodies
        mirrored = (bodies == bodies[..., ::-1]).all(axis=(1, 2))
        self._mirrored = torch.from_numpy(mirrored)[:, None, None]
        codes = np.array(self._layout.part_codes)[:, None, None]
        self._parts = torch.from_numpy(codes == bodies[:, None])
        self._occupied = torch.from_numpy(bodies != 0)

    def _keep(self, kept: NDArray[np.bool_]) -> None:
        """Go on with some of the bodies only."""
        chosen = torch.from_numpy(kept)
        self._weights = [weights[chosen] for weights in self._weights]
        self._moments = [[moment[chosen] for moment in moments] for moments in self._moments]
        self._aim_at(self._owners[kept], self._bodies[kept])

    def descend(self, steps: int) -> GrownGenomes:
        """Descend until all bodies grow with a margin, or all steps are done."""
        genomes = np.zeros((len(self._bodies), self._layout.num_parameters), dtype=np.float32)
        are_exact = np.zeros(len(self._bodies), dtype=np.bool_)
        for step in range(steps):
            leaves = [weights.requires_grad_() for weights in self._weights]
            layers = self._layers(leaves)
            losses, worst, grown = self._distances(layers)
            exact = (worst < _MARGIN / 2) & (grown == self._bodies).all(axis=(1, 2))
            finished = exact if step < steps - 1 else np.ones_like(exact)
            genomes[self._owners[finished]] = self._genomes(layers, finished)
            are_exact[self._owners[exact]] = True
            if finished.all():
                break
            losses.sum().backward()  # type: ignore[no-untyped-call]
            gradients = [_gradient(leaf) for leaf in leaves]
            self._weights = [leaf.detach() for leaf in leaves]
            self._step(gradients, step + 1)
            if finished.any():
                self._keep(~finished)
        return GrownGenomes(genomes, are_exact)

    def _step(self, gradients: list[Tensor], number: int) -> None:
        """Make Adam's step of that number, from 1, with the gradient of each body clipped."""
        squares = [gradient.square().sum((1, 2), keepdim=True) for gradient in gradients]
        norms = torch.stack(squares).sum(0).sqrt()
        scale = (_GRADIENT_NORM / (norms + 1e-6)).clamp(max=1.0)
        means, variances = self._moments
        for weights, gradient, mean, variance in zip(
            self._weights, gradients, means, variances, strict=True
        ):
            clipped = gradient * scale
            mean.lerp_(clipped, 1 - _MOMENTS[0])
            variance.lerp_(clipped.square(), 1 - _MOMENTS[1])
            size = (variance / (1 - _MOMENTS[1] ** number)).sqrt_().add_(_TINY)
            weights.addcdiv_(mean, size, value=-_LEARNING_RATE / (1 - _MOMENTS[0] ** number))

    def _layers(self, weights: list[Tensor]) -> list[Tensor]:
        reading, *others, bias = weights
        kernels = reading.view(*reading.shape[:2], -1, KERNEL_SIZE)
        average = (0.5 * (kernels + kernels.flip(-1))).view_as(reading)
        return [torch.where(self._mirrored, average, reading), *others, bias * self._biased]

    def _distances(
        self, layers: list[Tensor]
    ) -> tuple[Tensor, NDArray[np.float32], NDArray[np.int8]]:
        """Return the losses, the largest violations of a margin, and the bodies that grow."""
        count, size, _ = self._bodies.shape
        seed = seed_state(self._layout.channels, size)
        return self._distances_from(seed.expand(count, *seed.shape), growth_steps(size), layers)

    def _distances_from(
        self, state: Tensor, steps: int, layers: list[Tensor]
    ) -> tuple[Tensor, NDArray[np.float32], NDArray[np.int8]]:
        """Return the same for growth of so many steps from given states, ``(B, C, n, n)``."""
        reading, bias1, middle, writing, bias3 = layers
        histories = []
        for _ in range(steps):
            alive = alive_cells(state)
            seen = functional.unfold(state, KERNEL_SIZE, padding=1)
            hidden = functional.relu(torch.baddbmm(bias1, reading, seen))
            hidden = functional.relu(torch.bmm(middle, hidden))
            change = torch.baddbmm(bias3, writing, hidden) * self._updated
            state = (state + change.view_as(state)).clamp(-STATE_LIMIT, STATE_LIMIT) * alive
            histories.append(state[:, BODY_CHANNEL])
        values, parts = state[:, BODY_CHANNEL], state[:, self._layout.part_channels]
        full, none = ALIVE_THRESHOLD + _MARGIN, ALIVE_THRESHOLD - _MARGIN
        lacking = functional.relu(torch.where(self._occupied, full - values, values - none))
        is_alive = alive[:, 0]
        lacking = lacking * (is_alive | self._occupied)  # a dead cell is empty for certain
        own = (parts * self._parts).sum(1)
        others = parts.masked_fill(self._parts, -torch.inf).amax(1)
        mistaken = functional.relu(_MARGIN - (own - others)) * self._occupied
        # No gradient reaches a cell that is not alive: let the robot fill the grid on its way.
        cut_off = (self._occupied & ~is_alive).any(-1).any(-1)
        filling = torch.stack(
            [functional.relu(full - past).mean((1, 2)) for past in histories[:-1]]
        )
        losses = lacking.mean((1, 2)) + mistaken.mean((1, 2)) + cut_off * filling.mean(0)
        worst = torch.maximum(lacking, mistaken).amax((1, 2)).detach().numpy()
        return losses, worst, read_body(state, self._layout)

    def _genomes(self, layers: list[Tensor], chosen: NDArray[np.bool_]) -> NDArray[np.float32]:
        (first, second), layout = self._units, self._layout
        found = [layer.detach().numpy()[chosen] for layer in layers]
        count = len(found[0])
        genomes: NDArray[np.float32] = np.zeros((count, layout.num_parameters), dtype=np.float32)
        reading, bias1, middle, _, writing, bias3 = layout.layers(genomes)
        reading[:, -first:] = found[0].reshape(reading[:, -first:].shape)
        bias1[:, -first:] = found[1][..., 0]
        middle[:, -second:, -first:] = found[2][..., None, None]
        writing[:, :, -second:] = found[3][..., None, None]
        bias3[:] = found[4][..., 0]
        # Silence during control, when the flag is 1, whatever the states are.
        highest = STATE_LIMIT * np.abs(found[0]).sum(-1) + np.maximum(found[1][..., 0], 0)
        middle_cell = KERNEL_SIZE // 2
        reading[:, -first:, CONTROL_CHANNEL] = 0
        reading[:, -first:, CONTROL_CHANNEL, middle_cell, middle_cell] = -highest - 1
        return genomes


def _gradient(leaf: Tensor) -> Tensor:
    assert leaf.grad is not None
    return leaf.grad
