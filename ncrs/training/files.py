"""The files that a run writes to be resumed and read: checkpoints, champion, archive."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import Any

from ncrs.evolution.schema import StoredStateError, check_names
from ncrs.runs.champion import CHAMPION_FILE
from ncrs.runs.checkpoint import CHECKPOINT_FOLDER, CheckpointError, CheckpointFolder
from ncrs.runs.elites import ARCHIVE_FILE
from ncrs.runs.lock import RunError
from ncrs.runs.settings import TrainConfig, check_same_settings, lasting_settings
from ncrs.runs.wording import override
from ncrs.training.search import Search
from ncrs.training.selection import ChampionSelection
from ncrs.training.state import RunState
from ncrs.training.versions import versions, warn_of_other_versions


def holds_run(folder: Path) -> bool:
    """Return True if a folder holds a run that can be resumed."""
    return bool(CheckpointFolder(folder / CHECKPOINT_FOLDER).paths())


def check_new_run(folder: Path) -> None:
    """Raise ``RunError`` if a folder holds a run, which a new one must not overwrite."""
    if holds_run(folder):
        raise RunError(
            f"{folder} already holds a run; continue it with {override('resume', folder)}, or use "
            "another folder."
        )


class RunFiles:
    """Saves and loads all that a run's future depends on.

    Args:
        config: Settings of the run.
        run_dir: Folder of the run.
        search: Search to save and to restore.
        selection: Selection to save and to restore.
    """

    def __init__(
        self, config: TrainConfig, run_dir: Path, search: Search, selection: ChampionSelection
    ) -> None:
        self._config = config
        self._run_dir = run_dir
        self._search = search
        self._selection = selection
        self._checkpoints = CheckpointFolder(run_dir / CHECKPOINT_FOLDER)
        self._saved_at = perf_counter()

    @property
    def exist(self) -> bool:
        """True if the folder holds a run."""
        return holds_run(self._run_dir)

    @property
    def are_due(self) -> bool:
        """True if the last save began ``checkpoint_seconds`` ago and has ended."""
        is_time = perf_counter() - self._saved_at >= self._config.checkpoint_seconds
        # Training does not wait for a slow save: the next one comes later instead.
        return is_time and not self._checkpoints.is_writing

    def save(self, state: RunState) -> None:
        """Write all files.

        Args:
            state: Counters of the run; the time since the last save is added to their seconds.

        Raises:
            CheckpointError: If a file, or the checkpoint before this one, could not be written.
        """
        now = perf_counter()
        state.seconds += now - self._saved_at
        self._saved_at = now
        # Before the checkpoint: a run that ends with it never comes back to these.
        self._save_results()
        # In the background: a checkpoint with a full covariance is large.
        self._checkpoints.save_in_background(state.generation, self._checkpoint(state))

    def _save_results(self) -> None:
        if self._selection.champion is not None:
            self._selection.champion.save(self._run_dir / CHAMPION_FILE)
        self._search.elites.save(self._run_dir / ARCHIVE_FILE)

    def load(self) -> RunState:
        """Read the newest checkpoint; warn if other versions wrote it.

        Raises:
            ConfigError: If its run has other settings.
            CheckpointError: If there is no whole one.
        """
        checkpoint = self._checkpoints.load()
        needed = ("versions", "settings", "search", "selection", "run")
        try:
            check_names(checkpoint, needed, "The checkpoint", ())
            return self._loaded(checkpoint)
        except (StoredStateError, KeyError, TypeError) as error:
            raise CheckpointError(
                f"The newest checkpoint in {self._checkpoints.folder} is not one of this version: "
                f"{error}"
            ) from error

    def _loaded(self, checkpoint: dict[str, Any]) -> RunState:
        warn_of_other_versions(checkpoint["versions"])
        check_same_settings(checkpoint["settings"], self._own_settings())
        self._search.load_state(checkpoint["search"])
        self._selection.load_state(checkpoint["selection"])
        self._save_results()
        return RunState.from_state(checkpoint["run"])

    def wait(self) -> None:
        """Return when nothing is being written; raise any error of the last save."""
        self._checkpoints.wait()

    def _checkpoint(self, state: RunState) -> dict[str, Any]:
        return {
            "run": state.state(),
            "search": self._search.state(),
            "selection": self._selection.state(),
            "settings": self._own_settings(),
            "versions": versions(),
        }

    def _own_settings(self) -> dict[str, Any]:
        """Return the settings that must not change on resuming.

        The optimizer's are part of its own state, and the start of the search has passed.
        """
        settings = lasting_settings(self._config)
        del settings["optimizer"], settings["start_from"]
        return settings
