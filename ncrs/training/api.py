"""Training from Python: one call, with the settings and defaults of the command."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs.runs.champion import Champion
from ncrs.runs.elites import EliteArchive, load_archive
from ncrs.runs.engine_settings import ConfigError
from ncrs.runs.metrics import read_metrics
from ncrs.runs.settings import (
    TrainConfig,
    check_same_settings,
    config_from_dict,
    lasting_settings,
    load_config,
)
from ncrs.training.trainer import Trainer
from ncrs.training.watch import Callback, Watch

_NAMED_GROUPS = ("task", "optimizer", "engine")
_GROUPS = (*_NAMED_GROUPS, "perturbations")


@dataclass(frozen=True)
class TrainedRun:
    """A run that ``train`` has finished or stopped."""

    run_dir: Path
    config: TrainConfig
    champion: Champion | None
    """The champion; None if no genome grew a body that the task can use."""
    archive: EliteArchive
    curves: Mapping[str, NDArray[np.float64]]
    """Columns of metrics.csv by name, such as "fitness/best", each ``(generations,)``."""
    finished: bool
    """False if a signal or a callback stopped it; ``train`` with ``resume=True`` continues it."""


def train(
    run_dir: str | Path,
    *,
    callback: Callback | None = None,
    resume: bool = False,
    progress: bool = True,
    **settings: Any,
) -> TrainedRun:
    """Evolve a robot, as ``ncrs train`` does.

    Args:
        run_dir: Folder of the run, made if missing.
        callback: Function called after every generation with its genomes and results, and its
            metrics; it may return True to stop the run, which saves first.
        resume: Continue the run in the folder; its own settings are the defaults then.
        progress: Show a progress bar on stderr.
        **settings: Settings by name, with the defaults of ``ncrs train``, whose ``--help`` explains
            them. ``task``, ``optimizer`` and ``engine`` take a name, a mapping with "name" and
            other settings, or a record such as ``ncrs_envs.tasks.TaskSettings``;
            ``perturbations`` a mapping or a record.

    Raises:
        ConfigError: If a setting is unknown or out of range, or a resumed run's would change.
        RunError: If the folder holds a run and ``resume`` is False, or another process writes to
            it.
        CheckpointError: If the folder cannot be written, or there is nothing to resume.
        EngineError: If a worker was lost.
    """
    folder = Path(run_dir)
    given = {name: _plain(name, value) for name, value in settings.items()}
    config = _resumed_config(folder, given) if resume else config_from_dict(given).resolved()
    trainer = Trainer(config, folder, Watch(progress, callback))
    result = trainer.run()
    return TrainedRun(
        run_dir=folder,
        config=config,
        champion=result.champion,
        archive=load_archive(folder),
        curves=read_metrics(folder) if result.state.generation else {},
        finished=result.state.generation == config.generations,
    )


def _plain(name: str, value: Any) -> Any:
    """Convert a group of settings to a mapping: a name alone, or a record."""
    if name not in _GROUPS:
        return value
    if isinstance(value, str) and name in _NAMED_GROUPS:
        return {"name": value}
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    if not isinstance(value, Mapping):
        raise ConfigError(f"{name} must be a name, a mapping or a record, got {value!r}.")
    return value


def _resumed_config(folder: Path, given: Mapping[str, Any]) -> TrainConfig:
    """Return the settings of a run in a folder with the given changes."""
    own = load_config(folder)
    values = asdict(own)
    for name, value in given.items():
        values[name] = {**values[name], **value} if name in _GROUPS else value
    values["resume"] = str(folder)
    config = config_from_dict(values)
    check_same_settings(lasting_settings(own), lasting_settings(config))
    return config.resolved()
