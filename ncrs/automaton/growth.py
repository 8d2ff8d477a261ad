"""Growth: from one seed cell to a body. Source: paper section 3.1."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, overload

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from ncrs.automaton.channels import ALIVE_THRESHOLD, BODY_CHANNEL, NCALayout, growth_steps
from ncrs.automaton.nca import Automaton, NCAPopulation, check_automaton
from ncrs.automaton.torch_settings import one_torch_thread
from ncrs_envs.body import DEFAULT_GRID_SIZE, BodyGrid, check_grid_size

States = NDArray[np.float32]


@overload
def grow(
    nca: Automaton, grid_size: int = ..., *, history: Literal[False] = ..., seed: int | None = ...
) -> BodyGrid: ...


@overload
def grow(
    nca: Automaton, grid_size: int = ..., *, history: Literal[True], seed: int | None = ...
) -> tuple[BodyGrid, States]: ...


def grow(
    nca: Automaton,
    grid_size: int = DEFAULT_GRID_SIZE,
    *,
    history: bool = False,
    seed: int | None = None,
) -> BodyGrid | tuple[BodyGrid, States]:
    """Grow a body, or one per genome of a population.

    A cell is alive if the maximum body value in its 3 x 3 neighbourhood *before* an update exceeds
    0.1; all channels of other cells become zero. There are ``5 (n - n//2 - 1)`` steps.

    Args:
        nca: One NCA, or a population of P.
        grid_size: Side n of the grid, at least 3.
        history: True to also return the state after every step.
        seed: Seed for stochastic firing and state noise, where the NCA has them.

    Returns:
        The body, int8 ``(n, n)``, or ``(P, n, n)`` for a population; with ``history`` also the
        states, float32 ``(steps, n, n, C)``, or ``(P, steps, n, n, C)``.

    Raises:
        NoAutomatonError: ``nca`` is no automaton.
        BodyError: ``grid_size`` is not an integer of at least 3.
    """
    check_automaton(nca)
    grid_size = check_grid_size(grid_size)
    generator = None if seed is None else torch.Generator().manual_seed(seed)
    batch = (nca.size, 1) if isinstance(nca, NCAPopulation) else (1,)
    seed_cell = seed_state(nca.channels, grid_size).to(nca.device)
    state = seed_cell.expand(*batch, *seed_cell.shape)
    states = []
    with torch.no_grad():
        for _ in range(growth_steps(grid_size)):
            alive = alive_cells(state)
            state = nca(state, generator) * alive
            if history:
                states.append(state)
    # Drop the axis of one robot per genome; the channels go last.
    bodies = read_body(state, nca.layout).squeeze(-3)
    if not history:
        return bodies
    grown = torch.stack(states, dim=-4).squeeze(-5).movedim(-3, -1)
    return bodies, grown.cpu().numpy()


def regrow(nca: Automaton, body: BodyGrid, steps: int) -> BodyGrid:
    """Let a body grow on from where it stands.

    Growth begins with the body and part channels of the cells that there are, all others zero.

    Args:
        nca: One NCA.
        body: Cell codes, shape ``(n, n)``.
        steps: Number of growth steps.

    Returns:
        The body, int8 ``(n, n)``; the given one if a state turned non-finite, or if nothing is
        left.
    """
    state = standing_state(body, nca.layout).to(nca.device)[None]
    with torch.no_grad():
        for _ in range(steps):
            alive = alive_cells(state)
            state = nca(state) * alive
            if not bool(torch.isfinite(state).all()):
                return body
    grown = read_body(state, nca.layout)[0]
    return grown if grown.any() else body


def standing_state(body: BodyGrid, layout: NCALayout) -> Tensor:
    """Make the state in which a body begins to grow on, float32 ``(C, n, n)``."""
    state = torch.zeros((layout.channels, *body.shape), dtype=torch.float32, device="cpu")
    state[BODY_CHANNEL] = torch.from_numpy(body != 0).float()
    for channel, code in enumerate(layout.part_codes, start=layout.part_channels.start):
        state[channel] = torch.from_numpy(body == code).float()
    return state


@dataclass(frozen=True, eq=False)
class Growth:
    """Growth step by step, of one robot or of P: the seed, then T steps."""

    states: States
    """States with all channels, float32 ``(T + 1, n, n, C)``, or ``(P, T + 1, n, n, C)``."""
    bodies: BodyGrid
    """Bodies read out of the states, int8 ``(T + 1, n, n)``, or ``(P, T + 1, n, n)``."""


def record_growth(nca: Automaton, grid_size: int = DEFAULT_GRID_SIZE) -> Growth:
    """Grow a body, or one per genome of a population, and keep every step.

    Args:
        nca: One NCA, or a population of P.
        grid_size: Side n of the grid, at least 3.
    """
    with one_torch_thread():
        _, grown = grow(nca, grid_size, history=True)
    seed = seed_state(nca.channels, grid_size).movedim(0, -1).numpy()
    seeds = np.broadcast_to(seed, (*grown.shape[:-4], 1, *seed.shape))
    states = np.concatenate([seeds, grown], axis=-4)
    return Growth(states, read_body(torch.from_numpy(states).movedim(-1, -3), nca.layout))


def seed_state(channels: int, grid_size: int) -> Tensor:
    """Make the initial state of growth, float32 ``(C, n, n)``: body value 1 in the middle cell."""
    shape = (channels, grid_size, grid_size)
    state = torch.zeros(shape, dtype=torch.float32, device="cpu")
    state[BODY_CHANNEL, grid_size // 2, grid_size // 2] = 1.0
    return state


def alive_cells(state: Tensor) -> Tensor:
    """Tell which cells are alive, bool ``(..., 1, n, n)``, from states ``(..., C, n, n)``."""
    body = state[..., BODY_CHANNEL : BODY_CHANNEL + 1, :, :]
    flat = body.reshape(-1, 1, *body.shape[-2:])
    return (functional.max_pool2d(flat, 3, stride=1, padding=1) > ALIVE_THRESHOLD).view_as(body)


def read_body(state: Tensor, layout: NCALayout) -> BodyGrid:
    """Read bodies out of grown states.

    A cell is occupied if its body value exceeds 0.1; its type is the part channel with the maximum
    value, the first of them on a tie.

    Args:
        state: States, float32 ``(..., C, n, n)``.
        layout: Channels of the NCA.

    Returns:
        Cell codes, int8 ``(..., n, n)``.
    """
    values = state.detach().cpu().numpy()
    parts = values[..., layout.part_channels, :, :].argmax(axis=-3)
    codes = np.array(layout.part_codes, dtype=np.int8)[parts]
    occupied = values[..., BODY_CHANNEL, :, :] > ALIVE_THRESHOLD
    return np.where(occupied, codes, np.int8(0))
