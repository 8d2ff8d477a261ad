"""A run's champion: the genome that did best when it was evaluated again, with its body."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import NCALayout
from ncrs.automaton.nca import NCA
from ncrs.runs.checkpoint import CheckpointError, read_state, write_state
from ncrs.runs.settings import run_file
from ncrs_envs.body import parse_body
from ncrs_envs.tasks import TaskSettings

CHAMPION_FILE = "champion.npz"


@dataclass(frozen=True)
class Champion:
    """One genome and what is known of it."""

    genome: NDArray[np.float32]
    """Shape ``(num_parameters,)``."""
    body: NDArray[np.int8]
    """Cell codes, ``(n, n)``."""
    task: TaskSettings
    fitness: float
    """Mean over the scenarios that champions are compared on."""
    success: float
    """Share of those scenarios that succeeded, 0 to 1."""
    generation: int
    source: str
    """"sample" if it was drawn, "mean" if it is the mean of the search distribution, "elite" if it
    was the best of the archive."""

    @property
    def nca(self) -> NCA:
        """A new NCA with this genome."""
        return NCA(self.task.name).set_genome(self.genome)

    def state(self) -> dict[str, Any]:
        """Arrays and JSON values, for checkpoints; what subclasses add is left out."""
        known = {field.name: getattr(self, field.name) for field in fields(Champion)}
        return {**known, "task": asdict(self.task)}

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> Champion:
        """Inverse of ``state``; checks what it is given."""
        champion = cls(**{**state, "task": TaskSettings(**state["task"])})
        settings = champion.task
        NCALayout(settings.task).check_genomes(champion.genome)
        parse_body(champion.body, settings.grid_size)
        return champion

    def save(self, path: Path) -> None:
        """Write to one file, atomically."""
        write_state(path, self.state())


def load_champion_file(path: str | Path) -> Champion:
    """Load a champion from a run's folder or from a champion's file.

    Raises:
        ConfigError: neither is there.
        CheckpointError: the file is damaged, or holds something else.
    """
    path = run_file(
        path,
        CHAMPION_FILE,
        "give the folder of a run that has finished at least one round of candidates, or a "
        "champion's file.",
    )
    state = read_state(path)
    try:
        return Champion.from_state(state)
    except (TypeError, KeyError, ValueError) as error:
        raise CheckpointError(f"{path} does not hold a champion: {error}") from error
