"""Hydra's side of the settings: schema, groups, help, error messages, resuming, run folder."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields, replace
from pathlib import Path

from hydra import compose, initialize_config_dir
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.object_type import ObjectType
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import HydraException, MissingConfigException, OverrideParseException
from omegaconf import MISSING, DictConfig, OmegaConf
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException

from ncrs.engines.base import AUTO_ENGINE, ENGINES
from ncrs.evolution.optimizers import OPTIMIZERS
from ncrs.runs.settings import (
    ConfigError,
    EngineSettings,
    TrainConfig,
    check_same_settings,
    lasting_settings,
    load_config,
    unknown_setting,
)
from ncrs.training.explanations import all_explanations
from ncrs_envs.errors import NCRSError
from ncrs_envs.tasks import TASKS, TaskSettings

CONFIG_NAME = "config"
HYDRA_VERSION = "1.3"
SCHEMA = "train_schema"
_SWEEP_FLAGS = {"-m", "--multirun"}

_HELP = """\
Evolve a robot, or sweep over settings:

  python train.py SETTING=VALUE ...
  python train.py -m SETTING=VALUE,VALUE ...

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
    # A resumed run stays in its folder, and keeps Hydra's record of its start.
    OmegaConf.register_new_resolver(
        "ncrs_run_dir", lambda resume, new: new if resume is None else resume, replace=True
    )
    OmegaConf.register_new_resolver(
        "ncrs_hydra_dir", lambda resume: ".hydra" if resume is None else None, replace=True
    )
    OmegaConf.register_new_resolver(
        "ncrs_help", lambda: _HELP + all_explanations().replace("$", "$$"), replace=True
    )


@contextmanager
def _errors_of_hydra() -> Iterator[None]:
    """Turn Hydra's errors in the block into a ``ConfigError`` of one or two sentences."""
    try:
        yield
    except NCRSError:
        raise
    except (HydraException, OmegaConfBaseException, ValueError) as error:
        raise _config_error(error) from error


def _config_error(error: Exception) -> ConfigError:
    if isinstance(error, OverrideParseException):
        return ConfigError(f"Cannot read the setting {error.override!r}: {_first_line(error)}.")
    if isinstance(error, MissingConfigException) and error.missing_cfg_file:
        group, _, name = error.missing_cfg_file.partition("/")
        return ConfigError(f"Unknown {group} {name!r}; choose one of {', '.join(_choices(group))}.")
    cause = error.__cause__ or error
    if isinstance(cause, ConfigKeyError | ConfigAttributeError) and cause.object_type is not None:
        return unknown_setting(str(cause.full_key), cause.object_type)
    if isinstance(cause, OmegaConfBaseException) and cause.full_key:
        return ConfigError(f"{cause.full_key} is invalid: {_first_line(cause)}.")
    return ConfigError(f"{_first_line(error)}.")


def _first_line(error: Exception) -> str:
    return str(error).strip().partition("\n")[0].rstrip(".")


def _choices(group: str) -> list[str]:
    """List the names in a group of settings and in its folders."""
    loader = GlobalHydra.instance().config_loader()
    names = loader.get_group_options(group)
    for folder in loader.get_group_options(group, ObjectType.GROUP):
        names += [f"{folder}/{name}" for name in _choices(f"{group}/{folder}")]
    return names


def check_arguments(arguments: Sequence[str], folder: Path) -> None:
    """Check command-line arguments before Hydra makes a folder for them.

    Only the first job of a sweep is checked. Hydra's flags, except those for sweeps, may change the
    source of the settings; with such flags each job checks itself.

    Args:
        arguments: Command-line arguments.
        folder: Folder of ``config.yaml``.

    Raises:
        NCRSError: If a setting is unknown, a value out of range, or ``resume`` invalid.
    """
    flags = {argument for argument in arguments if argument.startswith("-")}
    if flags - _SWEEP_FLAGS:
        return
    with initialize_config_dir(str(folder), version_base=HYDRA_VERSION), _errors_of_hydra():
        overrides = [word for word in arguments if word not in flags]
        if flags:
            overrides = _first_job(overrides)
        config = train_config(compose(CONFIG_NAME, overrides), overrides)
    if flags and config.resume is not None:
        raise ConfigError("resume continues one run; leave out --multirun.")


def _parse(overrides: Sequence[str]) -> list[Override]:
    return OverridesParser.create().parse_overrides(list(overrides))


def _first_job(overrides: Sequence[str]) -> list[str]:
    """Return the overrides of a sweep's first job, except those with values chosen by a sweeper."""
    first = []
    for word, override in zip(overrides, _parse(overrides), strict=True):
        if not override.is_sweep_override():
            first.append(word)
        elif override.is_discrete_sweep():
            value = next(override.sweep_string_iterator())
            first.append(f"{override.get_key_element()}={value}")
    return first


def train_config(composed: DictConfig, overrides: Sequence[str]) -> TrainConfig:
    """Return the checked settings of a job: as composed, or those of the resumed run.

    Args:
        composed: Settings as Hydra composed them.
        overrides: Overrides of the job as Hydra received them.

    Raises:
        NCRSError: If a value is out of range, or a setting of the resumed run would change.
    """
    with _errors_of_hydra():
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
    for override in _parse(overrides):
        name, value = override.key_or_group, override.value()
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


def current_job(composed: DictConfig) -> tuple[TrainConfig, Path]:
    """Return settings and folder of the running Hydra job."""
    hydra = HydraConfig.get()
    config = train_config(composed, list(hydra.overrides.task))
    folder = Path(hydra.runtime.output_dir if config.resume is None else config.resume)
    try:
        folder = folder.resolve().relative_to(Path.cwd())
    except ValueError:
        return config, folder
    return config, folder
