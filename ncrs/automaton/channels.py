"""Channels and parameters of the NCA, shared by the torch module and the kernels.

Source: paper section 3 (the NCA); the layer sizes are those of the published runs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.device_genomes import AnyGenomes, DeviceGenomes
from ncrs_envs.body import Cell
from ncrs_envs.errors import NCRSError
from ncrs_envs.tasks import Task, get_task

BODY_CHANNEL = 0
CONTROL_CHANNEL = 1
FIRST_PART_CHANNEL = 2
HIDDEN_CHANNELS = 6
HIDDEN_UNITS = 30
"""Number of outputs of the first and of the second layer."""
KERNEL_SIZE = 3
ALIVE_THRESHOLD = 0.1
STATE_LIMIT = 5.0
"""Limit of the states, which are clipped to [-5, 5] after every update."""
LARGEST_CHANGE = 2.0 * STATE_LIMIT
"""From anywhere a change of that size reaches the limit: a larger one is not needed."""
STEPS_PER_ACTION = 2


class GenomeError(NCRSError, ValueError):
    """A genome of the wrong length, rank or dtype, or with values that are not finite."""


@dataclass(frozen=True)
class NCALayout:
    """Channels for one task, in order: body, control flag, parts, hidden, input/output."""

    task: Task

    @property
    def part_channels(self) -> slice:
        """Channels of the parts, in the order of ``task.part_cells``."""
        return slice(FIRST_PART_CHANNEL, FIRST_PART_CHANNEL + len(self.task.part_cells))

    @property
    def part_codes(self) -> tuple[int, ...]:
        """Cell codes of the part channels."""
        return tuple(int(cell) for cell in self.task.part_cells)

    @property
    def changing_channels(self) -> slice:
        """Channels that change during control: the hidden channels and the input/output channel."""
        return slice(self.part_channels.stop, self.channels)

    @property
    def io_channel(self) -> int:
        """Index of the input/output channel, the last one."""
        return self.channels - 1

    @property
    def channels(self) -> int:
        """Number of channels: 12, or 13 for CarryBall."""
        return FIRST_PART_CHANNEL + len(self.task.part_cells) + HIDDEN_CHANNELS + 1

    @property
    def channel_purposes(self) -> tuple[Cell | str, ...]:
        """Purposes of the channels, the same across tasks: the cell type of a part, or a name."""
        hidden = (f"hidden {index + 1}" for index in range(HIDDEN_CHANNELS))
        return ("body", "control flag", *self.task.part_cells, *hidden, "input/output")

    @property
    def channel_names(self) -> list[str]:
        """Names of the channels for display, in order."""
        return [
            self.task.cell_label(purpose) if isinstance(purpose, Cell) else purpose
            for purpose in self.channel_purposes
        ]

    @property
    def parameter_shapes(self) -> tuple[tuple[int, ...], ...]:
        """Shapes of weight and bias of the three layers, in the order of the genome."""
        channels = self.channels
        return (
            (HIDDEN_UNITS, channels, KERNEL_SIZE, KERNEL_SIZE),
            (HIDDEN_UNITS,),
            (HIDDEN_UNITS, HIDDEN_UNITS, 1, 1),
            (HIDDEN_UNITS,),
            (channels, HIDDEN_UNITS, 1, 1),
            (channels,),
        )

    @property
    def num_parameters(self) -> int:
        """Length of a genome: 4,572, or 4,873 for CarryBall."""
        return sum(int(np.prod(shape)) for shape in self.parameter_shapes)

    def layers(self, genomes: NDArray[Any]) -> list[NDArray[Any]]:
        """Split genomes into weight and bias of the three layers.

        Args:
            genomes: Shape ``(P, num_parameters)``.

        Returns:
            One array per entry of ``parameter_shapes``, each of shape ``(P, *shape)``.
        """
        ends = np.cumsum([int(np.prod(shape)) for shape in self.parameter_shapes])[:-1]
        return [
            part.reshape(len(genomes), *shape)
            for part, shape in zip(
                np.split(genomes, ends, axis=1), self.parameter_shapes, strict=True
            )
        ]

    @overload
    def symmetric(self, genomes: NDArray[np.float64]) -> NDArray[np.float64]: ...

    @overload
    def symmetric(self, genomes: DeviceGenomes) -> DeviceGenomes: ...

    def symmetric(self, genomes: AnyGenomes) -> AnyGenomes:
        """Project onto symmetric genomes, which treat left and right alike.

        The left and the right column of each 3 x 3 kernel are replaced by their average; the rest
        of the network does not distinguish left from right. A symmetric automaton grows
        mirror-symmetric bodies (up to ties and rounding), and steers by the difference between
        what its two sides sense.

        Args:
            genomes: Shape ``(P, num_parameters)``; not changed.

        Returns:
            The nearest symmetric genomes, float64, same shape, on a GPU if these are.
        """
        size = int(np.prod(self.parameter_shapes[0]))
        if isinstance(genomes, DeviceGenomes):
            tensor = genomes.tensor.clone()
            rows = tensor[:, :size].reshape(-1, KERNEL_SIZE)
            tensor[:, :size] = (0.5 * (rows + rows.flip(1))).reshape(len(genomes), size)
            return DeviceGenomes(tensor)
        result = np.array(genomes, dtype=np.float64)
        kernels = result[:, :size].reshape(-1, KERNEL_SIZE)
        kernels[:] = 0.5 * (kernels + kernels[:, ::-1])
        result[:, :size] = kernels.reshape(len(result), size)
        return result

    def check_genomes(self, genomes: Any) -> NDArray[np.float32]:
        """Return genomes as a float32 array ``(P, num_parameters)``.

        Args:
            genomes: Real numbers, shape ``(P, num_parameters)`` or ``(num_parameters,)``.

        Raises:
            GenomeError: The genomes have the wrong shape or dtype, or a value that is not finite in
                float32.
        """
        try:
            array = np.asarray(genomes)
        except (TypeError, ValueError) as error:
            raise GenomeError(f"genomes must be an array of numbers ({error}).") from error
        if not (np.issubdtype(array.dtype, np.floating) or np.issubdtype(array.dtype, np.integer)):
            raise GenomeError(f"genomes must hold real numbers, got dtype {array.dtype}.")
        array = np.atleast_2d(array)
        if array.ndim != 2 or array.shape[1] != self.num_parameters or array.shape[0] == 0:
            raise GenomeError(
                f"Genomes for {self.task.name} must have shape (P, {self.num_parameters}), "
                f"got {np.shape(genomes)}: a genome has {self.num_parameters} weights, "
                f"this one {array.shape[-1]}."
            )
        with np.errstate(over="ignore"):
            array = array.astype(np.float32)
        bad = ~np.isfinite(array)
        if bad.any():
            row = int(np.flatnonzero(bad.any(axis=1))[0])
            raise GenomeError(
                f"Genome {row} has {int(bad[row].sum())} non-finite values among its "
                f"{self.num_parameters} weights, the first at index {int(np.argmax(bad[row]))}; "
                "all must be finite float32 numbers."
            )
        return array


def nca_layout(task: str | Task) -> NCALayout:
    """Make the layout for a task or its name; raise ``TaskError`` if it is unknown."""
    return NCALayout(get_task(task))


def growth_steps(grid_size: int) -> int:
    """Count the growth steps, which reach every cell: ``5 (n - n//2 - 1)``, 10 for 5 x 5."""
    return 5 * (grid_size - grid_size // 2 - 1)
