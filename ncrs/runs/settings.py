"""The settings of a training run: plain records with their checks, and their JSON form.

A default and its explanation stand at the field; ``python train.py --help`` lists both.
``ncrs.training.hydra`` gives the records to Hydra, which nothing here needs.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any, TypeVar

from ncrs.engines.base import CLUSTER_ENGINES, resolve_engine
from ncrs.evolution.objective import FITNESS, ObjectiveError, check_objective
from ncrs.evolution.optimizers import OPTIMIZERS, OptimizerSettings, SepCMAESSettings
from ncrs.evolution.space import WEIGHTS, SpaceError, check_space
from ncrs.runs.checkpoint import write_json
from ncrs.runs.engine_settings import ConfigError, EngineSettings
from ncrs.runs.seeds import SeedError, check_seed
from ncrs.runs.wording import train_command
from ncrs_envs.checks import check_types, closest
from ncrs_envs.curriculum import NO_CURRICULUM
from ncrs_envs.errors import NCRSError
from ncrs_envs.mirroring import AUTO_MIRRORING, STANDARD, ScenarioSampling, resolve_mirroring
from ncrs_envs.perturbing import PerturbationSettings
from ncrs_envs.scenario import NOISE
from ncrs_envs.tasks import TaskSettings

SETTINGS_FILE = "config.json"

_Record = TypeVar("_Record")


# The records are not frozen: OmegaConf makes frozen dataclasses read-only.
@dataclass
class TrainConfig:
    """All settings of a run, checked where they are made.

    Raises:
        ConfigError: If a setting has another type, is out of range, or conflicts with another.
    """

    task: TaskSettings = field(default_factory=TaskSettings)
    optimizer: OptimizerSettings = field(default_factory=SepCMAESSettings)
    engine: EngineSettings = field(default_factory=EngineSettings)
    perturbations: PerturbationSettings = field(default_factory=PerturbationSettings)
    seed: int = 0
    """Seed of the whole run: it determines the result, whatever the number of workers."""
    generations: int = 1000
    """Number of generations of the run; may be raised on resuming."""
    episodes: int = 6
    """Episodes per evaluation; 12 in the paper."""
    common_scenarios: bool = True
    """Evaluate all genomes of a generation in the same scenarios; they are new every generation."""
    scenarios: str = STANDARD
    """Sampling of the scenarios: standard, by the task and the next two settings; or the name of a
    registered one."""
    mirroring: str = AUTO_MIRRORING
    """Mirror images of scenarios, so that driving blindly does not pay: none; front_back, the same
    light ahead and behind (where the other tasks never put it); all that the task allows, left and
    right too; or auto, those that make a difference to the search."""
    placement_noise: float = NOISE
    """Maximum distance of the light or ball from the middle of its region in training, 0 to 0.35 of
    the playfield's half side P, which is 60 units for 5 x 5 cells; champions are compared at the
    paper's 0.05."""
    curriculum: str = NO_CURRICULUM
    """Scenarios that begin easy and become the task's own: nearer, with the light or ball nearer
    and a passage wider; reverse, near the end; along, anywhere on the way to the ball; or the name
    of a registered one."""
    curriculum_generations: int = 500
    """Generations over which a curriculum's scenarios become the task's own."""
    symmetric: bool = True
    """Search only automata that treat left and right alike, which makes steering easier to find;
    without effect on drafts, whose controllers tell left from right."""
    objective: str = FITNESS
    """Value that the optimizer maximises: fitness, the mean reward; soft_success, the fraction of
    successes, where failures count more the nearer they came; or the name of a registered one."""
    success_bonus: float = 0.0
    """Bonus on the fitness of an episode that succeeds, for the optimizer only: the archive and all
    reports keep the plain fitness."""
    approach_bonus: float = 0.0
    """Bonus on that fitness, times exp(-d / P) with the episode's closest approach d."""
    recovery_bonus: float = 0.0
    """Bonus on that fitness, times the fraction of the lost modules that are back in the end."""
    space: str = WEIGHTS
    """Search space: weights, all of them; relays, sums and differences of what neighbours hold, in
    a body that is grown from the start; the gains of a robot by hand: carrier, which carries the
    ball, spare_parts or repairing, which go on after damage; or the name of a registered one."""
    start_from: str | None = None
    """Genome at which the search starts, instead of zero: a run's folder, a champion's file, or the
    name of a champion that comes with the package, of any task; or a genome's .npy."""
    champion_every: int = 25
    """Generations between two choices of the champion: the generation's best genome and the mean
    (or the best elite) are evaluated again, and the best so far is the champion."""
    champion_episodes: int = 48
    """Episodes of that evaluation, in the same scenarios for the whole run."""
    reestimate_every: int = 0
    """Generations between two evaluations of all the archive's elites on fresh scenarios; 0 for
    never. One costs as much as elites / population generations."""
    checkpoint_seconds: float = 30.0
    """Seconds between two checkpoints; 0 writes one every generation."""
    resume: str | None = None
    """Folder of a run to resume."""

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
        self._check_space()
        mirroring = self.sampling().mirroring
        if self.episodes % 2 and mirroring != "none":
            raise ConfigError(
                f"episodes must be even, since scenarios come in pairs of mirror images, got "
                f"{self.episodes!r}; or set mirroring=none."
            )
        self._check_objective()

    def _check_objective(self) -> None:
        try:
            check_objective(self.objective)
        except ObjectiveError as error:
            raise ConfigError(str(error)) from error
        bonus = max(self.success_bonus, self.approach_bonus, self.recovery_bonus)
        is_shaped = bonus > 0 or self.objective != FITNESS
        if is_shaped and not self.optimizer.maximises_fitness:
            raise ConfigError(
                f"objective and the bonuses change what an optimizer is told; "
                f"{self.optimizer.name} learns from its archive instead, which holds the plain "
                "fitness. Leave them out, or use another optimizer."
            )

    def _check_space(self) -> None:
        try:
            check_space(self.space)
        except SpaceError as error:
            raise ConfigError(str(error)) from error
        if self.space == WEIGHTS:
            return
        from_elites = getattr(self.optimizer, "restart_from", None) == "elite"
        if from_elites or not self.optimizer.maximises_fitness:
            raise ConfigError(
                f"space={self.space} needs an optimizer that does not start again from elites, "
                f"which are genomes; {self.optimizer.name} does. Use cma_es, sep_cma_es or "
                "iso_cma_es, with restart_from=mean."
            )

    def sampling(self) -> ScenarioSampling:
        """Return the checked sampling of scenarios, with "auto" mirroring resolved."""
        try:
            mirroring = resolve_mirroring(self.mirroring, self.task.task, self.symmetric)
            plain = ScenarioSampling(
                mirroring,
                self.placement_noise,
                self.scenarios,
                perturbations=replace(self.perturbations),
            ).check()
            if self.curriculum == NO_CURRICULUM:
                return plain
            eased = replace(
                plain,
                curriculum=self.curriculum,
                curriculum_generations=self.curriculum_generations,
            )
            eased.draw(self.task.task, 0, 1, self.task.grid_size, generation=0)
            return eased
        except ValueError as error:
            raise ConfigError(str(error)) from error

    def resolved(self) -> TrainConfig:
        """Return these settings with every "auto" resolved, but for workers that may have GPUs."""
        perturbed = self.perturbations.is_any
        engine = replace(
            self.engine, name=resolve_engine(self.engine.name, self.task, perturbed=perturbed)
        )
        if perturbed and engine.name in CLUSTER_ENGINES:
            engine.on_workers = resolve_engine(engine.on_workers, self.task, perturbed=perturbed)
        return replace(
            self,
            engine=engine,
            mirroring=self.sampling().mirroring,
        )


_MINIMA = {
    "generations": 1,
    "episodes": 1,
    "curriculum_generations": 1,
    "success_bonus": 0,
    "approach_bonus": 0,
    "recovery_bonus": 0,
    "champion_every": 1,
    "champion_episodes": 1,
    "reestimate_every": 0,
    "checkpoint_seconds": 0,
}


_GROUPS: Mapping[str, type] = {
    "task": TaskSettings,
    "engine": EngineSettings,
    "perturbations": PerturbationSettings,
}
"""Records of settings by the name of their group."""


def unknown_setting(name: str, record: type) -> ConfigError:
    """Build the error for a setting that a record does not have.

    Args:
        name: Dotted name of the setting.
        record: Class of the settings among which it was given.
    """
    group, _, key = name.rpartition(".")
    prefix = f"{group}." if group else ""
    if group == "optimizer":
        owners = [name for name, entry in OPTIMIZERS.items() if key in _names(entry.settings)]
        if owners:
            have = "has" if len(owners) == 1 else "have"
            own = {item.name: item.default for item in fields(record)}["name"]
            return ConfigError(f"{own} has no setting {name!r}; {' and '.join(owners)} {have} it.")
    known = {other: f"{prefix}{other}" for other in _names(record)}
    if record is TrainConfig:  # a setting of a group may have been given without the group
        groups = _GROUPS.items()
        optimizers = (("optimizer", entry.settings) for entry in OPTIMIZERS.values())
        for part, its_record in (*groups, *optimizers):
            for other in _names(its_record):
                known.setdefault(other, f"{part}.{other}")
    similar = [known[other] for other in closest(key, known)]
    hint = f" Did you mean {' or '.join(similar)}?" if similar else ""
    return ConfigError(f"Unknown setting {name!r}.{hint} {train_command()} --help lists all.")


def _names(record: type) -> list[str]:
    return [item.name for item in fields(record)]


def config_from_dict(values: Mapping[str, Any]) -> TrainConfig:
    """Build the settings from nested dicts of JSON values.

    Raises:
        ConfigError: If a setting is unknown, or a record refuses it.
    """
    _check_mapping(values, "The settings")
    for group in (*_GROUPS, "optimizer"):
        if group in values:
            _check_mapping(values[group], group)
    arguments = dict(values)
    try:
        for group, kind in _GROUPS.items():
            if group in values:
                arguments[group] = _record(kind, values[group], f"{group}.")
        if "optimizer" in values:
            name = values["optimizer"].get("name", SepCMAESSettings.name)
            if not isinstance(name, str) or name not in OPTIMIZERS:
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


def _check_mapping(values: Any, what: str) -> None:
    if not isinstance(values, Mapping) or not all(isinstance(name, str) for name in values):
        raise ConfigError(f"{what} must be names with values, got {values!r:.80}.")


def _record(record: type[_Record], values: Mapping[str, Any], prefix: str = "") -> _Record:
    for name in values:
        if name not in _names(record):
            raise unknown_setting(prefix + name, record)
    return record(**values)


def run_file(path: str | Path, name: str, hint: str) -> Path:
    """Find a file in a run's folder.

    Args:
        path: Folder of a run, or the file itself.
        name: Name of the file in the folder.
        hint: Path to give instead, as the end of the error's message.

    Raises:
        ConfigError: If there is no such file.
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


CHANGED_ON_RESUME = (
    "generations",
    "engine.workers",
    "engine.devices",
    "engine.scheduler",
    "engine.executor",
    "engine.threads",
    "engine.audit",
    "engine.other_versions",
    "checkpoint_seconds",
)
"""Settings that may change when a run is resumed."""


def lasting_settings(config: TrainConfig) -> dict[str, Any]:
    """Return the settings that a run keeps when it is resumed, as JSON values."""
    values = asdict(config.resolved())
    for name in (*CHANGED_ON_RESUME, "resume"):
        group, _, key = name.rpartition(".")
        del (values[group] if group else values)[key]
    return values


def flat_settings(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Flatten settings in groups to settings with dotted names."""
    flat: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, Mapping):
            flat |= flat_settings(value, f"{prefix}{name}.")
        else:
            flat[prefix + name] = value
    return flat


def check_same_settings(run: Mapping[str, Any], given: Mapping[str, Any], prefix: str = "") -> None:
    """Raise ``ConfigError``, which names both values, where settings differ from the run's own.

    Args:
        run: The run's settings by name, some of them in groups.
        given: The given settings in the same form. Only settings of both are compared.
        prefix: Name of the group that both are, with its dot.
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
    """Read a run's settings.

    Raises:
        ConfigError: If the folder holds no run, or its settings are invalid.
    """
    path = run_dir / SETTINGS_FILE
    if not path.is_file():
        raise ConfigError(f"{run_dir} holds no run: there is no {SETTINGS_FILE} in it.")
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{path} is not valid JSON: {error}.") from error
    except OSError as error:
        raise ConfigError(f"Could not read {path}: {error.strerror or error}.") from error
    try:
        return config_from_dict(values)
    except ConfigError as error:
        raise ConfigError(f"{path} does not hold the settings of a run: {error}") from error
