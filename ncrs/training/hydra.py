"""Hydra's side of the settings: schema, names, resuming, and the run's folder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from hydra.core.config_store import ConfigStore
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import OverrideParseException
from omegaconf import DictConfig, OmegaConf

from ncrs.engines.base import AUTO_ENGINE, resolve_engine
from ncrs.runs.settings import (
    CHANGED_ON_RESUME,
    ConfigError,
    TrainConfig,
    check_same_settings,
    check_setting_name,
    config_from_dict,
    lasting_settings,
    load_config,
    setting_names,
)
from ncrs_envs.mirroring import AUTO_MIRRORING

GROUPS = ("task", "optimizer", "engine", "experiment")
SCHEMA = "train_schema"


def register() -> None:
    """Make the schema and the resolvers of ``conf/config.yaml`` known to Hydra."""
    ConfigStore.instance().store(name=SCHEMA, node=TrainConfig)
    # A run that goes on stays in its folder, and keeps the record of how it was started.
    OmegaConf.register_new_resolver(
        "ncrs_run_dir", lambda resume, new: new if resume is None else resume, replace=True
    )
    OmegaConf.register_new_resolver(
        "ncrs_hydra_dir", lambda resume: ".hydra" if resume is None else None, replace=True
    )


def _parse(arguments: Sequence[str]) -> dict[str, Any]:
    """Overrides by dotted name; Hydra's own settings and flags are left to Hydra."""
    words = [word for word in arguments if "=" in word and not word.startswith("-")]
    try:
        overrides = OverridesParser.create().parse_overrides(words)
    except OverrideParseException as error:
        raise ConfigError(f"Cannot read the settings given: {error}") from error
    return {
        override.key_or_group: override.value()
        for override in overrides
        if override.key_or_group.split(".")[0].split("/")[0] != "hydra"
    }


def check_arguments(arguments: Sequence[str]) -> None:
    """Check command-line arguments before Hydra makes a folder for them.

    Raises:
        ConfigError: an unknown setting, or a ``resume`` that cannot be meant.
    """
    given = _parse(arguments)
    for name in given:
        check_setting_name(name, [*GROUPS, *setting_names()])
    resume = given.get("resume")
    if resume is None:
        return
    if {"-m", "--multirun"} & set(arguments):
        raise ConfigError("resume continues one run; leave out --multirun.")
    fixed: dict[str, Any] = {}
    for name in sorted(set(given) - {"resume", *CHANGED_ON_RESUME}):
        if name == "experiment":
            raise ConfigError("A resumed run keeps its own settings: leave out experiment.")
        group, _, key = (f"{name}.name" if name in GROUPS else name).rpartition(".")
        (fixed.setdefault(group, {}) if group else fixed)[key] = given[name]
    own = load_config(Path(str(resume)))
    if fixed.get("mirroring") == AUTO_MIRRORING:
        fixed["mirroring"] = replace(own, mirroring=AUTO_MIRRORING).sampling().mirroring
    if fixed.get("engine", {}).get("name") == AUTO_ENGINE:
        fixed["engine"]["name"] = resolve_engine(AUTO_ENGINE)
    check_same_settings(lasting_settings(own), fixed)


def train_config(composed: DictConfig, overrides: Sequence[str]) -> TrainConfig:
    """The checked settings of a job: as composed, or those of the run that goes on.

    Args:
        composed: what Hydra composed.
        overrides: the job's overrides as Hydra was given them.
    """
    values = OmegaConf.to_container(composed, resolve=True)
    assert isinstance(values, dict)
    if values["resume"] is None:
        config = config_from_dict({str(key): value for key, value in values.items()})
        return config.resolved()  # a run's record names what it really used
    given = _parse(overrides)
    own = replace(load_config(Path(values["resume"])), resume=values["resume"])
    for name in ("generations", "checkpoint_seconds"):
        if name in given:
            own = replace(own, **{name: values[name]})
    if "engine.workers" in given:
        own = replace(own, engine=replace(own.engine, workers=values["engine"]["workers"]))
    return own.check()


def current_job(composed: DictConfig) -> tuple[TrainConfig, Path]:
    """Settings and folder of the Hydra job that is running."""
    hydra = HydraConfig.get()
    config = train_config(composed, list(hydra.overrides.task))
    folder = Path(hydra.runtime.output_dir if config.resume is None else config.resume)
    try:
        folder = folder.resolve().relative_to(Path.cwd())
    except ValueError:
        return config, folder
    return config, folder
