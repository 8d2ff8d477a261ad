"""Control: copies of the NCA, one per cell, drive the robot. Source: paper section 3.2."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn import functional

from ncrs.automaton.channels import (
    BODY_CHANNEL,
    CONTROL_CHANNEL,
    STATE_LIMIT,
    STEPS_PER_ACTION,
)
from ncrs.automaton.nca import Automaton, NCAPopulation, check_automaton
from ncrs_envs.body import BodyError, BodyGrid, parse_body, sensor_mask, wheel_mask
from ncrs_envs.errors import NCRSError


class ObservationError(NCRSError, ValueError):
    """Observations of the wrong shape, or with values that are not finite."""


class StateError(NCRSError, RuntimeError):
    """A state of the automaton that is no longer finite.

    Attributes:
        robots: Indices of the robots with such a state, counted over all leading axes of the
            bodies.
    """

    def __init__(self, robots: Sequence[int]) -> None:
        super().__init__(
            f"The NCA's state is no longer finite in robots {list(robots)}; "
            "its weights are too large."
        )
        self.robots = tuple(robots)


class Controller:
    """Controller of one robot or a batch of robots: the NCA that grew them.

    Args:
        nca: One NCA, or a population of P.
        bodies: Cell codes, with shape ``(n, n)`` or any leading axes ``(..., n, n)`` for one NCA;
            ``(P, n, n)`` or ``(P, ..., n, n)`` for a population, with a row per genome.
        seed: Seed for stochastic firing and state noise, where the NCA has them.
        batch: Number of robots to step at a time, the last ones filled up with empty ones; by
            default all. torch's rounding depends on it, so that a fixed one makes a robot's path
            independent of its company.

    Raises:
        NoAutomatonError: ``nca`` is no automaton.
        BodyError: The bodies are malformed, or do not have one row per genome.
    """

    _state: torch.Tensor

    def __init__(
        self, nca: Automaton, bodies: Any, *, seed: int | None = None, batch: int | None = None
    ) -> None:
        check_automaton(nca)
        bodies = np.asarray(bodies)
        if bodies.ndim < 2:
            raise BodyError(f"bodies must have shape (..., n, n), got {bodies.shape}.")
        flat = np.stack([parse_body(body) for body in bodies.reshape(-1, *bodies.shape[-2:])])
        if isinstance(nca, NCAPopulation) and (bodies.ndim < 3 or bodies.shape[0] != nca.size):
            raise BodyError(
                f"A population of {nca.size} genomes needs bodies of shape "
                f"({nca.size}, ..., n, n), got {bodies.shape}."
            )
        self._nca = nca
        self._seed = seed
        self._batch = batch
        self._shape = bodies.shape
        rows = (nca.size, -1) if isinstance(nca, NCAPopulation) else (-1,)
        self._batched = (*rows, *bodies.shape[-2:])
        self._device = nca.device
        self._set_bodies(flat)
        self.reset()

    def _set_bodies(self, flat: NDArray[np.int8]) -> None:
        """Set what follows from the bodies, ``(robots, n, n)``."""

        def cells(mask: NDArray[np.bool_]) -> torch.Tensor:
            return torch.from_numpy(mask.reshape(self._batched)).to(self._device)

        self._occupied = cells(flat != 0)
        self._sensors = cells(sensor_mask(flat))
        self._wheels = cells(wheel_mask(flat))
        layout, grid_size = self._nca.layout, flat.shape[-1]
        self._start = torch.zeros(
            (*self._occupied.shape[:-2], layout.channels, grid_size, grid_size),
            dtype=torch.float32,
            device=self._device,
        )
        self._start[..., BODY_CHANNEL, :, :] = self._occupied.float()
        self._start[..., CONTROL_CHANNEL, :, :] = 1.0
        for channel, code in enumerate(layout.part_codes, start=layout.part_channels.start):
            self._start[..., channel, :, :] = cells(flat == code).float()

    def exchange(self, bodies: BodyGrid) -> None:
        """Go on in other bodies of the same shape; states are kept where both have a cell."""
        before, kept = self._state, self._occupied
        self._set_bodies(np.asarray(bodies).reshape(-1, *bodies.shape[-2:]))
        self._state = self._start.clone()
        changing = self._nca.layout.changing_channels
        shared = (kept & self._occupied).unsqueeze(-3)
        self._state[..., changing, :, :] = before[..., changing, :, :] * shared

    def reset(self) -> None:
        """Start an episode: set the hidden and input/output channels to zero."""
        self._state = self._start.clone()
        self._generator = None
        if self._seed is not None:
            self._generator = torch.Generator().manual_seed(self._seed)

    @property
    def states(self) -> NDArray[np.float32]:
        """Copy of the current states, float32 ``(..., n, n, C)``."""
        states = self._state.movedim(-3, -1).cpu().numpy()
        return np.array(states.reshape(*self._shape, -1))

    def _next_states(self) -> torch.Tensor:
        if self._batch is None:
            states: torch.Tensor = self._nca(self._state, self._generator)
            return states
        count = len(self._state)
        missing = -count % self._batch
        filled = functional.pad(self._state, (0, 0, 0, 0, 0, 0, 0, missing))
        starts = range(0, len(filled), self._batch)
        batches = [filled[start : start + self._batch] for start in starts]
        return torch.cat([self._nca(batch, self._generator) for batch in batches])[:count]

    def act(
        self,
        observations: Any,
        *,
        rests: NDArray[np.bool_] | None = None,
        noise: NDArray[np.float32] | None = None,
    ) -> NDArray[np.float32]:
        """Run two NCA steps and read the wheels.

        Before each step, the sensor values overwrite the input/output channel of sensor cells. Only
        occupied cells update.

        Args:
            observations: Sensor values in sensor cells, same shape as the bodies.
            rests: Mask of the robots whose states stay as they are, and whose gas is 0, shape as
                that of the bodies without the grid; None for none.
            noise: Noise on the hidden and the input/output channels after each step, ``(2, robots,
                channels, n, n)``; None for none.

        Returns:
            Gas in wheel cells, 0 elsewhere; float32, same shape. Environments clip it.

        Raises:
            ObservationError: The observations have the wrong shape, or a value that is not finite.
            StateError: The state has become non-finite.
        """
        inputs = np.asarray(observations, dtype=np.float32)
        if inputs.shape != self._shape:
            raise ObservationError(
                f"observations must have the bodies' shape {self._shape}, got {inputs.shape}."
            )
        if not np.isfinite(inputs).all():
            raise ObservationError(
                f"observations must be finite, got {np.count_nonzero(~np.isfinite(inputs))} that "
                "are not."
            )
        sensed = torch.from_numpy(inputs.reshape(self._sensors.shape)).to(self._device)
        layout = self._nca.layout
        changing, io = layout.changing_channels, layout.io_channel
        occupied = self._occupied.unsqueeze(-3)
        before = None if rests is None else self._state.clone()
        with torch.no_grad():
            for step in range(STEPS_PER_ACTION):
                signal = self._state[..., io, :, :]
                torch.where(self._sensors, sensed, signal, out=signal)
                updated = self._next_states()[..., changing, :, :]
                if noise is not None:
                    drawn = torch.from_numpy(noise[step]).to(self._device).view_as(updated)
                    updated = (updated + drawn).clamp(-STATE_LIMIT, STATE_LIMIT)
                self._state[..., changing, :, :] = updated * occupied
        if rests is not None and before is not None:
            resting = torch.from_numpy(rests.reshape(self._state.shape[:-3])).to(self._device)
            self._state = torch.where(resting[..., None, None, None], before, self._state)
        gas = self._state[..., io, :, :] * self._wheels
        actions = np.array(gas.cpu().numpy().reshape(self._shape), dtype=np.float32)
        if rests is not None:
            actions[rests] = 0.0
        finite = torch.isfinite(self._state).flatten(-3).all(dim=-1).flatten()
        if not finite.all():
            raise StateError(torch.nonzero(~finite).flatten().tolist())
        return actions
