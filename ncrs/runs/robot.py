"""One evolved robot, wherever it comes from."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import GenomeError, nca_layout
from ncrs.automaton.growth import Growth, record_growth
from ncrs.automaton.nca import NCA, nca_of
from ncrs_envs.body import body_measures, parse_body
from ncrs_envs.tasks import TaskSettings


@dataclass(frozen=True, eq=False)
class EvolvedRobot:
    """A genome with its body and its task, checked where it is made.

    Raises:
        GenomeError: If the genome does not fit the task.
        BodyError: If the body is malformed, or the task cannot use it.
    """

    genome: NDArray[np.float32]
    """All weights of its NCA, ``(num_parameters,)``."""
    body: NDArray[np.int8]
    """Cell codes, ``(n, n)``."""
    task: TaskSettings
    fitness: float
    """Mean reward over the scenarios that it was evaluated on; NaN if unknown."""
    success: float
    """Fraction of those scenarios that succeeded, 0 to 1; NaN if unknown."""
    name: str = field(default="", kw_only=True)
    """Name of a published champion, such as "light_chase/best", or of a file; empty for others."""

    def __post_init__(self) -> None:
        task = self.task.task
        if np.ndim(self.genome) != 1:
            raise GenomeError(
                f"A robot has one genome, a vector of weights, got shape {np.shape(self.genome)}."
            )
        nca_layout(task).check_genomes(self.genome)
        task.check_body(parse_body(self.body, self.task.grid_size))

    @property
    def nca(self) -> NCA:
        """A new NCA with this genome."""
        return nca_of(self.genome, self.task.name)

    def growth(self) -> Growth:
        """Grow the body again and keep every step."""
        return record_growth(self.nca, self.task.grid_size)

    @property
    def measures(self) -> tuple[int, int, int]:
        """Number of sensors, wheels and occupied cells of the body."""
        sensors, wheels, cells = body_measures(self.body).tolist()
        return sensors, wheels, cells

    @property
    def title(self) -> str:
        """Name of the robot for display."""
        return self.name or "robot"
