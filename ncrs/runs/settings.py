"""The settings of a training run: plain records with their checks, and their JSON form.

A default and its explanation stand at the field; ``python train.py --help`` lists both.
``ncrs.training.hydra`` gives the records to Hydra; nothing here needs it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any, TypeVar

from ncrs.engines.base import AUTO_ENGINE, check_workers, resolve_engine
from ncrs.evolution.optimizers import OPTIMIZERS, OptimizerSettings, SepCMAESSettings
from ncrs.runs.checkpoint import write_json
from ncrs.runs.seeds import SeedError, check_seed
from ncrs_envs.checks import check_types, closest
from ncrs_envs.errors import NCRSError
from ncrs_envs.mirroring import AUTO_MIRRORING, ScenarioSampling, resolve_mirroring
from ncrs_envs.scenario import NOISE
from ncrs_envs.tasks import TaskSettings

SETTINGS_FILE = "config.json"

_Record = TypeVar("_Record")


class ConfigError(NCRSError, ValueError):
    """A setting that is unknown or out of range."""


# The records are not frozen: OmegaConf makes frozen dataclasses read-only.
@dataclass
class EngineSettings:
    """The engine that evaluates the populations.

    Raises:
        ConfigError: a setting is of another type.
        EngineSettingError: there is no such engine, or ``workers`` is not positive.
    """

    name: str = AUTO_ENGINE
    """The engine; chosen with engine=NAME: batched, a whole population in one compiled call; box2d,
    the reference physics; or auto, the faster of those that work here."""
    workers: int | None = None
    """Threads of batched, processes of box2d; null for one per core. They do not change results."""

    def __post_init__(self) -> None:
        check_types(self, ConfigError)
        resolve_engine(self.name)
        check_workers(self.workers)


@dataclass
class TrainConfig:
    """All settings of a run, checked where they are made.

    Raises:
        ConfigError: a setting is of another type, out of range, or does not go with another.
    """

    task: TaskSettings = field(default_factory=TaskSettings)
    optimizer: OptimizerSettings = field(default_factory=SepCMAESSettings)
    engine: EngineSettings = field(default_factory=EngineSettings)
    seed: int = 0
    """Seed of the whole run: it decides the result, whatever the number of workers."""
    generations: int = 1000
    """Generations until the run ends; may be raised on resuming."""
    episodes: int = 6
    """Episodes per evaluation; 12 in the paper."""
    common_scenarios: bool = True
    """All genomes of a generation meet the same scenarios, new ones every generation."""
    mirroring: str = AUTO_MIRRORING
    """Scenarios in mirror images, so that driving blindly cannot pay: none; front_back, a light
    ahead and the same behind (where the other tasks never put it); all images within the task, left
    and right too; or auto, those that make a difference to what is searched."""
    placement_noise: float = NOISE
    """Largest distance of light or ball from its usual place in training, 0 to 0.35 of the
    playfield's half side P, which is 60 units for 5 x 5 cells; champions are compared at the
    paper's 0.05."""
    symmetric: bool = True
    """Search only automata that treat left and right alike, which makes steering easier to find."""
    success_bonus: float = 0.0
    """Added to the fitness of an episode that succeeds, as the optimizer is told it; the archive
    and all reports keep the plain fitness."""
    approach_bonus: float = 0.0
    """Added to that fitness, times exp(-d / P) with the episode's closest approach d."""
    start_from: str | None = None
    """Genome at which the search starts, instead of zero: a run's folder, a champion's file, or the
    name of a champion that comes with the package; of any task."""
    champion_every: int = 25
    """Generations from one round of the champion to the next: the generation's best genome and the
    mean (or the best elite) are evaluated again; the best so far is the champion."""
    champion_episodes: int = 48
    """Episodes of such an evaluation, on the same scenarios for the whole run."""
    reestimate_every: int = 0
    """Generations between two evaluations of all the archive's elites on fresh scenarios; 0 for
    never. One costs as much as elites / population generations."""
    checkpoint_seconds: float = 30.0
    """Seconds between two checkpoints; 0 writes one every generation."""
    resume: str | None = None
    """Folder of a run to continue."""

    def __post_init__(self) -> None:
        check_types(self, ConfigError)
        for name, minimum in _MINIMA.items():
            value = getattr(self, name)
            if not minimum <= value < math.inf:
                raise ConfigError(f"{name} must be at least {minimum} and finite, got {value!r}.")
        try:
            check_seed(self.seed)
        except SeedError as error:
            raise ConfigError(str(error)) from error
        mirroring = self.sampling().mirroring
        if self.episodes % 2 and mirroring != "none":
            raise ConfigError(
                f"episodes must be even, since scenarios come in pairs of mirror images, got "
                f"{self.episodes!r}; or set mirroring=none."
            )
        bonus = max(self.success_bonus, self.approach_bonus)
        if bonus > 0 and not self.optimizer.maximises_fitness:
            raise ConfigError(
                f"success_bonus and approach_bonus change the fitness that an optimizer is told; "
                f"{self.optimizer.name} learns from its archive instead, which holds the plain "
                "fitness. Leave them out, or use another optimizer."
            )

    def sampling(self) -> ScenarioSampling:
        """The sampling of scenarios, with the mirroring that "auto" stands for; checked."""
        try:
            mirroring = resolve_mirroring(self.mirroring, self.task.task, self.symmetric)
            return ScenarioSampling(mirroring, self.placement_noise).check()
        except ValueError as error:
            raise ConfigError(str(error)) from error

    def resolved(self) -> TrainConfig:
        """These settings with what "auto" stands for in its place."""
        return replace(
            self,
            engine=replace(self.engine, name=resolve_engine(self.engine.name)),
            mirroring=self.sampling().mirroring,
        )


_MINIMA = {
    "generations": 1,
    "episodes": 1,
    "success_bonus": 0,
    "approach_bonus": 0,
    "champion_every": 1,
    "champion_episodes": 1,
    "reestimate_every": 0,
    "checkpoint_seconds": 0,
}


def unknown_setting(name: str, record: type) -> ConfigError:
    """The error for a setting that a record does not have.

    Args:
        name: Dotted name of the setting.
        record: Class of the settings among which it was given.
    """
    group, _, key = name.rpartition(".")
    of = f"{group}." if group else ""
    if group == "optimizer":
        owners = [name for name, entry in OPTIMIZERS.items() if key in _names(entry.settings)]
        if owners:
            have = "has" if len(owners) == 1 else "have"
            own = {item.name: item.default for item in fields(record)}["name"]
            return ConfigError(f"{own} has no setting {name!r}; {' and '.join(owners)} {have} it.")
    known = {other: f"{of}{other}" for other in _names(record)}
    if record is TrainConfig:  # a setting of a group may have been given without the group
        groups = (("task", TaskSettings), ("engine", EngineSettings))
        optimizers = (("optimizer", entry.settings) for entry in OPTIMIZERS.values())
        for part, its_record in (*groups, *optimizers):
            for other in _names(its_record):
                known.setdefault(other, f"{part}.{other}")
    similar = [known[other] for other in closest(key, known)]
    hint = f" Did you mean {' or '.join(similar)}?" if similar else ""
    return ConfigError(f"Unknown setting {name!r}.{hint} python train.py --help lists all.")


def _names(record: type) -> list[str]:
    return [item.name for item in fields(record)]


def config_from_dict(values: Mapping[str, Any]) -> TrainConfig:
    """Build the settings from nested dicts, as JSON holds them.

    Raises:
        ConfigError: a setting is unknown, or one of the records refuses it.
    """
    arguments = dict(values)
    try:
        if "task" in values:
            arguments["task"] = _record(TaskSettings, values["task"], "task.")
        if "engine" in values:
            arguments["engine"] = _record(EngineSettings, values["engine"], "engine.")
        if "optimizer" in values:
            name = values["optimizer"].get("name", SepCMAESSettings.name)
            if name not in OPTIMIZERS:
                raise ConfigError(
                    f"Unknown optimizer {name!r}; choose one of {', '.join(OPTIMIZERS)}."
                )
            record = OPTIMIZERS[name].settings
            arguments["optimizer"] = _record(record, values["optimizer"], "optimizer.")
        return _record(TrainConfig, arguments)
    except ConfigError:
        raise
    except NCRSError as error:
        raise ConfigError(str(error)) from error


def _record(record: type[_Record], values: Mapping[str, Any], prefix: str = "") -> _Record:
    for name in values:
        if name not in _names(record):
            raise unknown_setting(prefix + name, record)
    return record(**values)


def run_file(path: str | Path, name: str, hint: str) -> Path:
    """The file of that name in a run's folder, or ``path`` itself where it is such a file.

    Raises:
        ConfigError: it does not exist; ``hint`` says what to give instead.
    """
    path = Path(path)
    if path.is_dir():
        path = path / name
    if not path.is_file():
        raise ConfigError(f"{path} does not exist: {hint}")
    return path


def save_config(config: TrainConfig, run_dir: Path) -> None:
    """Write a run's settings into its folder."""
    values = asdict(config)
    del values["resume"]
    write_json(run_dir / SETTINGS_FILE, values)


CHANGED_ON_RESUME = ("generations", "engine.workers", "checkpoint_seconds")
"""Settings that may differ when a run is resumed; all others are the run's own."""


def lasting_settings(config: TrainConfig) -> dict[str, Any]:
    """The settings that a run keeps when it is resumed, as JSON can hold them."""
    values = asdict(config.resolved())
    for name in (*CHANGED_ON_RESUME, "resume"):
        group, _, key = name.rpartition(".")
        del (values[group] if group else values)[key]
    return values


def check_same_settings(run: Mapping[str, Any], given: Mapping[str, Any], prefix: str = "") -> None:
    """Raise ``ConfigError``, which names both values, where settings differ from the run's own.

    Args:
        run: Settings by name, some of them in groups.
        given: Settings in the same form. What only one of them names is not compared.
        prefix: Name of the group that both are.
    """
    for name, value in run.items():
        if name not in given:
            continue
        if isinstance(value, Mapping):
            check_same_settings(value, given[name], f"{prefix}{name}.")
        elif given[name] != value:
            raise ConfigError(
                f"A resumed run keeps its own settings: its {prefix}{name} is {value!r}, "
                f"{given[name]!r} was given. Only {', '.join(CHANGED_ON_RESUME)} may change."
            )


def load_config(run_dir: Path) -> TrainConfig:
    """Read a run's settings; ``ConfigError`` if the folder holds no run."""
    path = run_dir / SETTINGS_FILE
    if not path.is_file():
        raise ConfigError(f"{run_dir} holds no run: there is no {SETTINGS_FILE} in it.")
    try:
        values = json.loads(path.read_text())
    except ValueError as error:
        raise ConfigError(f"{path} is not valid JSON: {error}.") from error
    return config_from_dict(values)
