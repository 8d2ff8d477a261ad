"""The settings with their explanations, read from their definitions."""

from __future__ import annotations

import ast
import inspect
import json
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, fields
from functools import cache
from typing import Any, NamedTuple

from ncrs.evolution.optimizers import OPTIMIZERS
from ncrs.runs.engine_settings import EngineSettings
from ncrs.runs.settings import TrainConfig
from ncrs_envs.perturbing import PerturbationSettings
from ncrs_envs.tasks import TaskSettings

_WIDTH = 100
_INDENT = "    "


class Explanation(NamedTuple):
    """Default and explanation of a setting."""

    default: Any
    text: str


@cache
def _texts(record: type) -> Mapping[str, str]:
    """Read the strings below the fields of a class, without those that it inherits."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(record)))
    except OSError:  # a class that was typed into an interpreter has no source to read
        return {}
    definition = tree.body[0]
    assert isinstance(definition, ast.ClassDef)
    texts = {}
    for item, below in zip(definition.body, definition.body[1:], strict=False):
        if not (isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name)):
            continue
        if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
            texts[item.target.id] = " ".join(str(below.value.value).split())
    return texts


def explanations(record: type) -> dict[str, Explanation]:
    """List default and explanation of each field of a dataclass; "" if it has no explanation."""
    result = {}
    for item in fields(record):
        if item.default is MISSING:
            continue  # a record of its own
        sources = (_texts(owner) for owner in record.__mro__ if owner is not object)
        text = next((texts[item.name] for texts in sources if item.name in texts), "")
        result[item.name] = Explanation(item.default, text)
    return result


def _yaml(value: Any) -> str:
    """Format a value as on the command line."""
    return value if isinstance(value, str) else json.dumps(value)


def _paragraph(text: str) -> str:
    return textwrap.fill(
        text, _WIDTH, initial_indent=_INDENT, subsequent_indent=_INDENT, break_on_hyphens=False
    )


def _of_record(record: type, prefix: str = "") -> Iterator[str]:
    for name, (default, text) in explanations(record).items():
        yield f"{prefix}{name}={_yaml(default)}"
        yield _paragraph(text)


def _of_optimizers() -> Iterator[str]:
    """List each optimizer; then each setting once, with its default for each optimizer."""
    records = {name: explanations(entry.settings) for name, entry in OPTIMIZERS.items()}
    for optimizer, entry in OPTIMIZERS.items():
        yield f"optimizer={optimizer}"
        yield _paragraph(" ".join((entry.settings.__doc__ or "").split()))
    for name in dict.fromkeys(name for record in records.values() for name in record):
        own = {optimizer: record[name] for optimizer, record in records.items() if name in record}
        owners: dict[str, list[str]] = {}
        for optimizer, explanation in own.items():
            owners.setdefault(_yaml(explanation.default), []).append(optimizer)
        yield f"optimizer.{name}"
        yield _paragraph(next(iter(own.values())).text)
        if name != "name":
            defaults = (f"{value} for {', '.join(names)}" for value, names in owners.items())
            yield _paragraph(f"Default: {'; '.join(defaults)}.")


def all_explanations() -> str:
    """Format every setting of a run with its default and its explanation, as text."""
    return "\n".join(
        [
            *_of_record(TrainConfig),
            *_of_record(TaskSettings, "task."),
            *_of_record(EngineSettings, "engine."),
            *_of_record(PerturbationSettings, "perturbations."),
            *_of_optimizers(),
        ]
    )
