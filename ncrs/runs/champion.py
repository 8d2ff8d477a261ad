"""A run's champion: the genome that did best when it was evaluated again, with its body."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ncrs.runs.checkpoint import CheckpointError, read_state, write_state
from ncrs.runs.robot import EvolvedRobot
from ncrs.runs.settings import run_file
from ncrs_envs.tasks import TaskSettings

CHAMPION_FILE = "champion.npz"


@dataclass(frozen=True, eq=False)
class Champion(EvolvedRobot):
    """A robot with its fitness on the scenarios that a run compares champions on."""

    generation: int
    """Index of the generation that found it."""
    source: str
    """"sample" if it was drawn, "mean" if it is the mean of the search distribution, "elite" if it
    was the best of the archive."""

    @property
    def title(self) -> str:
        """Name of the robot for display."""
        return self.name or f"champion of generation {self.generation}"

    def state(self) -> dict[str, Any]:
        """Return arrays and JSON values for a checkpoint, without name and card."""
        return {
            "genome": self.genome,
            "body": self.body,
            "task": asdict(self.task),
            "fitness": self.fitness,
            "success": self.success,
            "generation": self.generation,
            "source": self.source,
        }

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> Champion:
        """Build a champion from its ``state``."""
        return cls(**{**state, "task": TaskSettings(**state["task"])})

    def save(self, path: Path) -> None:
        """Write to one file, atomically."""
        write_state(path, self.state())


def load_champion_file(path: str | Path) -> Champion:
    """Load a champion from a run's folder or from a champion's file.

    Raises:
        ConfigError: If there is neither.
        CheckpointError: If the file is damaged, or holds something else.
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


def find_champion(run_dir: Path) -> Champion | None:
    """Load a run's champion; None if it has none yet. See ``load_champion_file`` for errors."""
    return load_champion_file(run_dir) if (run_dir / CHAMPION_FILE).is_file() else None
