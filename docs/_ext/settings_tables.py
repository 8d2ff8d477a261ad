"""Every setting of a run with its default and its explanation, from the one schema."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from ncrs.evolution.optimizers import OPTIMIZERS
from ncrs.runs.engine_settings import EngineSettings
from ncrs.runs.settings import TrainConfig
from ncrs.training.explanations import Explanation, explanations
from ncrs_envs.perturbing import PerturbationSettings
from ncrs_envs.tasks import TaskSettings


def _value(value: Any) -> str:
    return f"`{value if isinstance(value, str) else json.dumps(value)}`"


def _entry(name: str, default: str, text: str) -> str:
    return f"`{name}`\n: {text} Default: {default}.\n"


def _of_record(record: type, prefix: str = "") -> str:
    return "\n".join(
        _entry(prefix + name, _value(default), text)
        for name, (default, text) in explanations(record).items()
    )


def run_settings() -> str:
    """Describe the settings of the run itself."""
    return _of_record(TrainConfig)


def task_settings() -> str:
    """Describe the settings of the task."""
    return _of_record(TaskSettings, "task.")


def perturbation_settings() -> str:
    """Describe the settings of damage, failures and noise."""
    return _of_record(PerturbationSettings, "perturbations.")


def engine_settings() -> str:
    """Describe the settings of the engine."""
    return _of_record(EngineSettings, "engine.")


def optimizer_settings() -> str:
    """Describe the optimizers; then each setting once, with its default for each optimizer."""
    return "\n".join([*_optimizers(), "### Their settings\n", *_settings_of_optimizers()])


def _optimizers() -> Iterator[str]:
    for name, entry in OPTIMIZERS.items():
        yield f"`optimizer={name}`\n: {' '.join((entry.settings.__doc__ or '').split())}\n"


def _settings_of_optimizers() -> Iterator[str]:
    records = {name: explanations(entry.settings) for name, entry in OPTIMIZERS.items()}
    for name in dict.fromkeys(name for record in records.values() for name in record):
        if name == "name":
            continue
        own = {optimizer: record[name] for optimizer, record in records.items() if name in record}
        yield _entry(f"optimizer.{name}", _defaults(own), next(iter(own.values())).text)


def _defaults(own: dict[str, Explanation]) -> str:
    owners: dict[str, list[str]] = {}
    for optimizer, explanation in own.items():
        owners.setdefault(_value(explanation.default), []).append(f"`{optimizer}`")
    if len(owners) == 1 and len(own) == len(OPTIMIZERS):
        return next(iter(owners))
    return "; ".join(f"{value} for {', '.join(names)}" for value, names in owners.items())
