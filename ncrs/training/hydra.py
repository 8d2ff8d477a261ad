"""Hydra's side of the settings: schema, groups, help, error messages, resuming, folders."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields, replace
from pathlib import Path

from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.core.object_type import ObjectType
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import HydraException, MissingConfigException, OverrideParseException
from omegaconf import MISSING, DictConfig, OmegaConf
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException

from ncrs.engines.base import AUTO_ENGINE, ENGINES
from ncrs.evolution.optimizers import OPTIMIZERS
from ncrs.runs.engine_settings import ConfigError, EngineSettings
from ncrs.runs.settings import (
    TrainConfig,
    check_same_settings,
    lasting_settings,
    load_config,
    unknown_setting,
)
from ncrs.runs.wording import override, train_command
from ncrs.training.explanations import all_explanations
from ncrs.training.files import holds_run
from ncrs_envs.checks import closest
from ncrs_envs.errors import NCRSError
from ncrs_envs.tasks import TASKS, TaskSettings

CONFIG_NAME = "config"
_EXTRAS = {
    "hydra/launcher": {"joblib": "sweep", "submitit_local": "slurm", "submitit_slurm": "slurm"},
    "hydra/sweeper": {"optuna": "sweep"},
}
"""Plugins of Hydra by group and name, with the extra that installs them."""
HYDRA_VERSION = "1.3"
BASIC_SWEEPER = "hydra._internal.core_plugins.basic_sweeper.BasicSweeper"
SCHEMA = "train_schema"

_LONGEST_NAME = 150
"""Maximum number of characters of a job's name, without its digest."""


def _help() -> str:
    command = train_command()
    return f"""\
Evolve a robot, or sweep over settings:

  {command} SETTING=VALUE ...
  {command} -m SETTING=VALUE,VALUE ...

Groups of settings, of which one is chosen with GROUP=NAME:

$APP_CONFIG_GROUPS

Settings, with their defaults:

"""


def register() -> None:
    """Make the schema, the groups and the resolvers of ``conf/config.yaml`` known to Hydra."""
    schema = OmegaConf.structured(TrainConfig)
    # Otherwise the settings of a chosen optimizer would be merged into those of the default one.
    schema.optimizer = MISSING
    store = ConfigStore.instance()
    store.store(name=SCHEMA, node=schema)
    for task in TASKS:
        store.store(group="task", name=task, node=TaskSettings(task))
    for optimizer, entry in OPTIMIZERS.items():
        store.store(group="optimizer", name=optimizer, node=entry.settings)
    for engine in (AUTO_ENGINE, *ENGINES):
        store.store(group="engine", name=engine, node=EngineSettings(engine))
    resolvers: Mapping[str, Callable[..., object]] = {
        # A resumed run stays in its folder, and keeps Hydra's record of its start.
        "ncrs_run_dir": lambda resume, new: new if resume is None else resume,
        "ncrs_hydra_dir": lambda folder: None if holds_run(Path(folder)) else ".hydra",
        "ncrs_job_name": job_name,
        "ncrs_help": lambda: _help() + all_explanations().replace("$", "$$"),
    }
    for name, resolver in resolvers.items():
        OmegaConf.register_new_resolver(name, resolver, replace=True)


def job_name(overrides: str, number: int | None) -> str:
    """Name the folder of a sweep's job by what was swept, so that a sweep finds its jobs again.

    Args:
        overrides: Overrides that were swept, such as "optimizer.sigma=0.1,seed=3".
        number: Number of the job, its name if nothing was swept.
    """
    if not overrides:
        return str(number)
    name = re.sub(r"[^\w.=,+-]+", "_", overrides)
    if name == overrides and len(name) <= _LONGEST_NAME:
        return name
    # Distinct overrides keep distinct folders.
    digest = hashlib.sha256(overrides.encode()).hexdigest()[:8]
    return f"{name[:_LONGEST_NAME]}-{digest}"


@contextmanager
def errors_of_hydra() -> Iterator[None]:
    """Turn Hydra's errors in the block into a ``ConfigError`` of one or two sentences."""
    try:
        yield
    except NCRSError:
        raise
    except (HydraException, OmegaConfBaseException, ValueError) as error:
        raise config_error(error) from error


def config_error(error: Exception) -> ConfigError:
    """Turn an error of Hydra or OmegaConf into one or two sentences."""
    if isinstance(error, OverrideParseException):
        return _unreadable(error)
    if isinstance(error, MissingConfigException) and error.missing_cfg_file:
        group, _, name = error.missing_cfg_file.rpartition("/")
        if group in _EXTRAS and name in _EXTRAS[group]:
            return ConfigError(
                f"{group}={name} needs the extra {_EXTRAS[group][name]}: "
                f"pip install 'ncrs[{_EXTRAS[group][name]}]'."
            )
        group, _, name = error.missing_cfg_file.partition("/")
        if group == "hydra":  # a group of Hydra's own
            subgroup, _, name = name.rpartition("/")
            group = f"hydra/{subgroup}"
        return ConfigError(f"Unknown {group} {name!r}; {_advice(group, name)}.")
    cause = error.__cause__ or error.__context__ or error
    if isinstance(cause, ConfigKeyError | ConfigAttributeError) and cause.object_type is not None:
        return unknown_setting(str(cause.full_key), cause.object_type)
    if isinstance(cause, OmegaConfBaseException) and cause.full_key:
        return ConfigError(f"{cause.full_key} is invalid: {_first_line(cause)}.")
    return ConfigError(f"{_first_line(error)}.")


def _unreadable(error: OverrideParseException) -> ConfigError:
    name, is_setting, value = error.override.partition("=")
    if is_setting and not value.isascii():  # Hydra's grammar knows ASCII only outside quotes
        return ConfigError(
            f"Cannot read the setting {error.override!r}: put a value with such letters in quotes, "
            f"{override(name, value)}."
        )
    return ConfigError(f"Cannot read the setting {error.override!r}: {_first_line(error)}.")


def _first_line(error: Exception) -> str:
    return str(error).strip().partition("\n")[0].rstrip(".")


def _advice(group: str, name: str) -> str:
    """Say what may be chosen in place of an unknown name; of many folders only their names."""
    choices = _choices(group)
    folder, is_inside, _ = name.rpartition("/")
    inside = [choice for choice in choices if is_inside and choice.startswith(f"{folder}/")]
    if inside or not any("/" in choice for choice in choices):
        return f"choose one of {', '.join(inside or choices)}"
    folders = dict.fromkeys(re.sub("/.*", "/...", choice) for choice in choices)
    advice = f"choose one of {', '.join(folders)}, which --help lists"
    similar = closest(name, choices)
    return f"did you mean {' or '.join(similar)}? Else {advice}" if similar else advice


def _choices(group: str) -> list[str]:
    """List the names in a group of settings and in its folders."""
    loader = GlobalHydra.instance().config_loader()
    names = loader.get_group_options(group)
    for folder in loader.get_group_options(group, ObjectType.GROUP):
        names += [f"{folder}/{name}" for name in _choices(f"{group}/{folder}")]
    return names


def parse_overrides(overrides: Sequence[str]) -> list[Override]:
    """Parse overrides of the command line."""
    return OverridesParser.create().parse_overrides(list(overrides))


def train_config(composed: DictConfig, overrides: Sequence[str]) -> TrainConfig:
    """Return the checked settings of a job: as composed, or those of the resumed run.

    Args:
        composed: Settings as Hydra composed them.
        overrides: Overrides of the job as Hydra received them.

    Raises:
        NCRSError: If a value is out of range, or a setting of the resumed run would change.
    """
    with errors_of_hydra():
        _check_known(composed)
        if composed.resume is not None:
            return _resumed(composed.resume, overrides)
        config: TrainConfig = OmegaConf.to_object(composed)  # type: ignore[assignment]
    return config.resolved()  # a run records the engine and mirroring that it uses


def _check_known(composed: DictConfig, prefix: str = "") -> None:
    """Raise ``ConfigError`` for a setting that was added, as with +NAME=VALUE."""
    record = OmegaConf.get_type(composed)
    known = {item.name for item in fields(record)}  # type: ignore[arg-type]
    for name in map(str, composed):
        if name not in known:
            raise unknown_setting(prefix + name, record)  # type: ignore[arg-type]
        if not OmegaConf.is_missing(composed, name) and OmegaConf.is_dict(composed[name]):
            _check_known(composed[name], f"{prefix}{name}.")


def _resumed(folder: str, overrides: Sequence[str]) -> TrainConfig:
    """Load the settings of the run in a folder, with the changes that the overrides may make."""
    own = load_config(Path(folder))
    values = OmegaConf.structured(own)
    for word in parse_overrides(overrides):
        name, value = word.key_or_group, word.value()
        if name == "experiment":
            raise ConfigError("A resumed run keeps its own settings: leave out experiment.")
        if name == "optimizer":
            if value != own.optimizer.name:
                values.optimizer = OPTIMIZERS[str(value)].settings
        elif name in ("task", "engine"):
            values[name].name = value
        elif name.split(".")[0].split("/")[0] != "hydra":
            OmegaConf.update(values, name, value)
    given: TrainConfig = OmegaConf.to_object(values)  # type: ignore[assignment]
    check_same_settings(lasting_settings(own), lasting_settings(given))
    return replace(given, resume=folder).resolved()
