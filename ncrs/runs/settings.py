"""The settings of a training run: plain records with their checks, and their JSON form.

``ncrs.training.hydra`` gives them to Hydra; nothing here needs it.
"""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, get_type_hints

from ncrs.engines.base import AUTO_ENGINE, check_workers, resolve_engine
from ncrs.evolution.optimizers.base import check_settings
from ncrs.runs.checkpoint import write_json
from ncrs.runs.seeds import check_seed
from ncrs_envs.errors import NCRSError
from ncrs_envs.mirroring import ScenarioSampling, resolve_mirroring
from ncrs_envs.scenario import NOISE
from ncrs_envs.tasks import TaskSettings

SETTINGS_FILE = "config.json"


class ConfigError(NCRSError, ValueError):
    """A setting that is unknown or out of range."""


@dataclass
class OptimizerConfig:
    """Which optimizer, and its settings; null means that optimizer's own default.

    Every optimizer knows some of the settings; giving it another is an error.
    """

    name: str = "sep_cma_es"
    sigma: float | None = None
    population: int | None = None
    told_popsize: bool | None = None
    step_size: str | None = None
    sigma_decay: float | None = None
    sigma_min: float | None = None
    restart_sigma: float | None = None
    restart_from: str | None = None
    linear_algebra: str | None = None
    precision: str | None = None
    device: str | None = None
    diagonal: bool | None = None
    emitters: int | None = None
    patience: int | None = None
    ranking: str | None = None
    learning_rate: float | None = None
    threshold_min: float | None = None
    initial_sigma: float | None = None
    initial_genomes: int | None = None
    iso_sigma: float | None = None
    line_sigma: float | None = None
    sparse_fraction: float | None = None
    sparse_sigma_min: float | None = None
    sparse_sigma_max: float | None = None

    def given(self) -> dict[str, Any]:
        """The settings that are not null, without the name."""
        values = asdict(self)
        del values["name"]
        return {key: value for key, value in values.items() if value is not None}


@dataclass
class EngineConfig:
    """Which engine; ``workers`` null means one per core."""

    name: str = AUTO_ENGINE
    workers: int | None = None


@dataclass
class TrainConfig:
    """All settings of a run. The defaults here are the paper's, as far as they go; those of
    ``train.py`` are in ``conf/config.yaml``, and find robots sooner."""

    task: TaskSettings = field(default_factory=TaskSettings)
    optimizer: OptimizerConfig = field(default_factory=OptimizerConfig)
    engine: EngineConfig = field(default_factory=EngineConfig)
    seed: int = 0
    generations: int = 100
    episodes: int = 12
    """Scenarios per evaluation."""
    common_scenarios: bool = True
    """Whether a generation's genomes share their scenarios (common random numbers)."""
    mirroring: str = "none"
    """"none", or whether scenarios come in mirror images: "front_back", "all", or "auto", see
    ``ncrs_envs.mirroring``."""
    placement_noise: float = NOISE
    """Of light or ball in training, as a share of the playfield extent; champions are compared on
    the task's own 0.05."""
    symmetric: bool = False
    """Search only automata that treat left and right alike."""
    success_bonus: float = 0.0
    """What a run that succeeds adds to the fitness, in the eyes of the optimizer."""
    approach_bonus: float = 0.0
    """What its closest approach adds, times ``exp(-d / P)`` with the playfield's half side P; see
    ``ncrs.evolution.objective``."""
    start_from: str | None = None
    """Where the search starts instead of at zero: a run's folder, a champion's file, or the name of
    one that comes with the package; of any task, see ``ncrs.automaton.transfer``."""
    champion_every: int = 10
    """Generations between two re-evaluations of the candidates for champion."""
    champion_episodes: int = 48
    """Scenarios of such a re-evaluation, the same for the whole run."""
    reestimate_every: int = 0
    """Generations between two re-estimations of all the archive's elites; 0 for none."""
    checkpoint_seconds: float = 30.0
    """Seconds between two checkpoints; 0 writes one every generation."""
    resume: str | None = None
    """Folder of a run to continue."""

    def sampling(self) -> ScenarioSampling:
        """How scenarios are drawn, with the mirroring that "auto" stands for; checked."""
        task = self.task.task
        mirroring = resolve_mirroring(self.mirroring, task, self.symmetric)
        return ScenarioSampling(mirroring, self.placement_noise).check()

    def resolved(self) -> TrainConfig:
        """These settings with what "auto" stands for in its place."""
        return replace(
            self,
            engine=replace(self.engine, name=resolve_engine(self.engine.name)),
            mirroring=self.sampling().mirroring,
        )

    def check(self) -> TrainConfig:
        """Return this if all values are in range, else raise ``ConfigError``."""
        try:
            sampling = self.sampling()
            optimizer = check_settings(self.optimizer.name, self.optimizer.given())
            resolve_engine(self.engine.name)
            check_workers(self.engine.workers)
            check_seed(self.seed)
        except ValueError as error:
            raise ConfigError(str(error)) from error
        if self.episodes % 2 and sampling.mirroring != "none":
            raise ConfigError(
                f"episodes must be even, since scenarios come in pairs of mirror images, got "
                f"{self.episodes!r}; or set mirroring=none."
            )
        least = {
            "generations": (self.generations, 1),
            "episodes": (self.episodes, 1),
            "success_bonus": (self.success_bonus, 0),
            "approach_bonus": (self.approach_bonus, 0),
            "champion_every": (self.champion_every, 1),
            "champion_episodes": (self.champion_episodes, 1),
            "reestimate_every": (self.reestimate_every, 0),
            "checkpoint_seconds": (self.checkpoint_seconds, 0),
        }
        for name, (value, bound) in least.items():
            if not bound <= value < math.inf:
                raise ConfigError(f"{name} must be at least {bound} and finite, got {value!r}.")
        bonus = max(self.success_bonus, self.approach_bonus)
        if bonus > 0 and not optimizer.maximises_fitness:
            raise ConfigError(
                f"success_bonus and approach_bonus change the fitness that an optimizer is told; "
                f"{self.optimizer.name} learns from its archive instead, which holds the plain "
                "fitness. Leave them out, or use another optimizer."
            )
        return self


def setting_names(config: type = TrainConfig, prefix: str = "") -> list[str]:
    """Dotted names of all settings."""
    hints = get_type_hints(config)
    names = []
    for item in fields(config):
        kind = hints[item.name]
        if is_dataclass(kind):
            names += setting_names(kind, f"{prefix}{item.name}.")  # type: ignore[arg-type]
        else:
            names.append(prefix + item.name)
    return names


def check_setting_name(name: str, known: Iterable[str]) -> None:
    """Raise ``ConfigError`` with the known names, and the closest, unless ``name`` is one."""
    known = list(known)
    if name not in known:
        close = difflib.get_close_matches(name, known, n=1)
        hint = f" Did you mean {close[0]}?" if close else ""
        raise ConfigError(f"Unknown setting {name!r}.{hint} Known are: {', '.join(known)}.")


def config_from_dict(values: Mapping[str, Any]) -> TrainConfig:
    """Build a checked config from nested dicts; ``ConfigError`` names what is unknown."""
    parts = {"task": TaskSettings, "optimizer": OptimizerConfig, "engine": EngineConfig}
    arguments: dict[str, Any] = {}
    for key, value in values.items():
        check_setting_name(key, (item.name for item in fields(TrainConfig)))
        if key in parts:
            for name in value:
                check_setting_name(name, (item.name for item in fields(parts[key])))
            arguments[key] = parts[key](**value)
        else:
            arguments[key] = value
    return TrainConfig(**arguments).check()


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
"""Settings that may differ when a run goes on; all others are the run's own."""


def lasting_settings(config: TrainConfig) -> dict[str, Any]:
    """The settings that a run keeps when it goes on, as JSON can hold them."""
    values = asdict(config.resolved())
    for name in (*CHANGED_ON_RESUME, "resume"):
        group, _, key = name.rpartition(".")
        del (values[group] if group else values)[key]
    return values


def check_same_settings(run: Mapping[str, Any], given: Mapping[str, Any], prefix: str = "") -> None:
    """Raise ``ConfigError``, which names both values, where settings differ from the run's own.

    Args:
        run: settings by name, some of them in groups.
        given: the same. What only one of them names is not compared.
        prefix: name of the group that both are.
    """
    for name in sorted(run.keys() & given.keys()):
        value = run[name]
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
