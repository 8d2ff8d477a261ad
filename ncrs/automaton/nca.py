"""The neural cellular automaton as a torch module, for one genome or a population of them.

Source: paper section 3; the layer sizes are those of the published runs.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional
from torch.nn.utils import parameters_to_vector, vector_to_parameters

from ncrs.automaton.channels import (
    CONTROL_CHANNEL,
    HIDDEN_UNITS,
    KERNEL_SIZE,
    STATE_LIMIT,
    GenomeError,
    NCALayout,
    nca_layout,
)
from ncrs_envs.errors import NCRSError
from ncrs_envs.tasks import Task

_DTYPE = torch.float32


class AutomatonError(NCRSError, ValueError):
    """A setting of an automaton that is out of range."""


def _check_range(name: str, value: float, low: float, high: float) -> float:
    if not low <= value <= high:
        raise AutomatonError(f"{name} must lie in [{low:g}, {high:g}], got {value!r}.")
    return float(value)


class _CellularAutomaton(nn.Module, ABC):
    """Update rule around the network, common to one automaton and a population."""

    def __init__(self, task: str | Task, fire_rate: float, state_noise: float) -> None:
        super().__init__()
        self.layout: NCALayout = nca_layout(task)
        self.fire_rate = _check_range("fire_rate", fire_rate, 0.0, 1.0)
        self.state_noise = _check_range("state_noise", state_noise, 0.0, STATE_LIMIT)

    @property
    def task(self) -> Task:
        """Task of the robots."""
        return self.layout.task

    @property
    def channels(self) -> int:
        """Number of channels C: 12, or 13 for CarryBall."""
        return self.layout.channels

    @property
    def num_parameters(self) -> int:
        """Length of a genome: 4,572, or 4,873 for CarryBall."""
        return self.layout.num_parameters

    @property
    def device(self) -> torch.device:
        """Device of the weights."""
        return [*self.parameters(), *self.buffers()][0].device

    @abstractmethod
    def delta(self, states: Tensor) -> Tensor:
        """Compute the network's output ``dx`` for states, shapes as in ``forward``."""

    def forward(self, states: Tensor, generator: torch.Generator | None = None) -> Tensor:
        """Update every cell: ``clip(x + dx, -5, 5)``; the control flag does not change.

        Args:
            states: States, float32 ``(B, C, H, W)``; for a population ``(P, B, C, H, W)``.
            generator: Generator for stochastic firing and state noise, if they are on.

        Returns:
            The next states, same shape.
        """
        delta = self.delta(states)
        if self.state_noise > 0.0:
            noise = torch.randn(states.shape, generator=generator, dtype=states.dtype, device="cpu")
            delta = delta + self.state_noise * noise.to(states.device)
        if self.fire_rate < 1.0:
            cells = states.shape[:-3] + (1,) + states.shape[-2:]
            drawn = torch.rand(cells, generator=generator, dtype=states.dtype, device="cpu")
            delta = delta * (drawn < self.fire_rate).to(states.device)
        updated = (states + delta).clamp(-STATE_LIMIT, STATE_LIMIT)
        updated[..., CONTROL_CHANNEL, :, :] = states[..., CONTROL_CHANNEL, :, :]
        return updated


class NCA(_CellularAutomaton):
    """One neural cellular automaton, whose weights are the genome of a robot.

    ``dx = conv1x1_C(relu(conv1x1_30(relu(conv3x3_30(x)))))`` with zero padding and biases. The
    flat genome is ``parameters_to_vector(nca.parameters())``: weight and bias of each layer in
    turn. A new NCA has torch's default random weights, on the CPU and in float32; ``set_genome``
    replaces them.

    Args:
        task: Task or its name, "light_chase", "obstacle" or "carry_ball".
        fire_rate: Probability that a cell updates in a step; 1 in the paper.
        state_noise: Standard deviation of normal noise added to ``dx``; 0 in the paper.

    Raises:
        TaskError: The task is unknown.
        AutomatonError: ``fire_rate`` or ``state_noise`` is out of range.
    """

    def __init__(
        self,
        task: str | Task = "light_chase",
        *,
        fire_rate: float = 1.0,
        state_noise: float = 0.0,
    ) -> None:
        super().__init__(task, fire_rate, state_noise)

        def layer(inputs: int, outputs: int, side: int) -> nn.Conv2d:
            padding = side // 2
            return nn.Conv2d(inputs, outputs, side, padding=padding, device="cpu", dtype=_DTYPE)

        self.conv1 = layer(self.channels, HIDDEN_UNITS, KERNEL_SIZE)
        self.conv2 = layer(HIDDEN_UNITS, HIDDEN_UNITS, 1)
        self.conv3 = layer(HIDDEN_UNITS, self.channels, 1)

    def delta(self, states: Tensor) -> Tensor:
        """Compute ``dx``, shape ``(B, C, H, W)``."""
        hidden = functional.relu(self.conv1(states))
        out: Tensor = self.conv3(functional.relu(self.conv2(hidden)))
        return out

    def set_genome(self, genome: Any) -> NCA:
        """Set all weights from a flat vector, and return this module.

        Args:
            genome: Finite real numbers, shape ``(num_parameters,)``; array, tensor or sequence.

        Raises:
            GenomeError: The genome has the wrong shape or dtype, or values that are not finite.
        """
        if isinstance(genome, Tensor):
            genome = genome.detach().cpu().numpy()
        rows = self.layout.check_genomes(genome)
        if np.ndim(genome) != 1:
            raise GenomeError(
                f"A genome must be a vector of {self.num_parameters} weights, "
                f"got shape {np.shape(genome)}."
            )
        vector = torch.from_numpy(rows[0])
        with torch.no_grad():
            vector_to_parameters(vector.to(self.device), self.parameters())
        return self

    def genome(self) -> NDArray[np.float32]:
        """Return a copy of all weights as a flat float32 vector, shape ``(num_parameters,)``."""
        vector = parameters_to_vector(self.parameters()).detach().cpu().numpy()
        return np.array(vector, dtype=np.float32)


class NCAPopulation(_CellularAutomaton):
    """P automata with a genome each, updated in one batched call.

    Args:
        genomes: Finite real numbers, shape ``(P, num_parameters)``.
        task: Task or its name, as for ``NCA``.
        fire_rate: Probability that a cell updates in a step, as for ``NCA``.
        state_noise: Standard deviation of normal noise added to ``dx``, as for ``NCA``.

    Raises:
        GenomeError: The genomes have the wrong shape or dtype, or values that are not finite.
        TaskError: The task is unknown.
        AutomatonError: ``fire_rate`` or ``state_noise`` is out of range.
    """

    def __init__(
        self,
        genomes: Any,
        task: str | Task = "light_chase",
        *,
        fire_rate: float = 1.0,
        state_noise: float = 0.0,
    ) -> None:
        super().__init__(task, fire_rate, state_noise)
        vectors = torch.from_numpy(self.layout.check_genomes(genomes))
        self.size = vectors.shape[0]
        sizes = [int(np.prod(shape)) for shape in self.layout.parameter_shapes]
        for index, part in enumerate(torch.split(vectors, sizes, dim=1)):
            # Weights become (P, out, in), biases (P, out, 1), to multiply (P, in, columns).
            out = self.layout.parameter_shapes[index][0]
            kind = "bias" if index % 2 else "weight"
            self.register_buffer(f"{kind}{index // 2 + 1}", part.reshape(self.size, out, -1))

    weight1: Tensor
    bias1: Tensor
    weight2: Tensor
    bias2: Tensor
    weight3: Tensor
    bias3: Tensor

    def delta(self, states: Tensor) -> Tensor:
        """Compute ``dx``, shape ``(P, B, C, H, W)``."""
        population, batch, channels, height, width = states.shape
        patches = functional.unfold(states.flatten(0, 1), KERNEL_SIZE, padding=KERNEL_SIZE // 2)
        columns = patches.reshape(population, batch, -1, height * width)
        columns = columns.transpose(1, 2).reshape(population, columns.shape[2], -1)
        hidden = functional.relu(torch.baddbmm(self.bias1, self.weight1, columns))
        hidden = functional.relu(torch.baddbmm(self.bias2, self.weight2, hidden))
        out = torch.baddbmm(self.bias3, self.weight3, hidden)
        out = out.reshape(population, channels, batch, height, width)
        return out.transpose(1, 2)


Automaton = NCA | NCAPopulation


class NoAutomatonError(NCRSError, TypeError):
    """Something else in the place of an NCA."""


def check_automaton(nca: Any) -> None:
    """Raise ``NoAutomatonError`` unless ``nca`` is an ``NCA`` or an ``NCAPopulation``."""
    if not isinstance(nca, _CellularAutomaton):
        raise NoAutomatonError(
            f"nca must be an ncrs.NCA or an ncrs.NCAPopulation, got {type(nca).__name__}; of a "
            "genome, make one with ncrs.NCA(task).set_genome(genome)."
        )


def nca_of(genome: Any, task: str | Task) -> NCA:
    """Make the NCA of a genome; torch's global generator is left as it was.

    Raises:
        GenomeError: The genome does not fit the task.
        TaskError: The task is unknown.
    """
    with torch.random.fork_rng(devices=[]):
        nca = NCA(task)
    return nca.set_genome(genome)
