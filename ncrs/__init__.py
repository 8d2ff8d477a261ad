"""Grow a modular robot from one cell, and drive it, with one neural cellular automaton."""

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from ncrs.automaton.channels import GenomeError as GenomeError
    from ncrs.automaton.control import Controller as Controller
    from ncrs.automaton.grow_to import grow_to as grow_to
    from ncrs.automaton.growth import grow as grow
    from ncrs.automaton.keras_order import convert_keras_genome as convert_keras_genome
    from ncrs.automaton.keras_order import convert_to_keras as convert_to_keras
    from ncrs.automaton.nca import NCA as NCA
    from ncrs.automaton.nca import NCAPopulation as NCAPopulation
    from ncrs.automaton.regrow_to import regrow_to as regrow_to
    from ncrs.engines.base import Evaluation as Evaluation
    from ncrs.engines.base import register_engine as register_engine
    from ncrs.engines.evaluate import evaluate as evaluate
    from ncrs.evolution.objective import register_objective as register_objective
    from ncrs.evolution.optimizers.registry import register_optimizer as register_optimizer
    from ncrs.evolution.space import register_search_space as register_search_space
    from ncrs.runs.elites import Elite as Elite
    from ncrs.runs.elites import EliteArchive as EliteArchive
    from ncrs.runs.elites import load_archive as load_archive
    from ncrs.runs.elites import load_elite as load_elite
    from ncrs.runs.published import champions as champions
    from ncrs.runs.published import load_champion as load_champion
    from ncrs.training.api import TrainedRun as TrainedRun
    from ncrs.training.api import train as train

# Imported on use, so that what needs only one of them, such as ``ncrs --help``, starts at once.
_HOMES = {
    "NCA": "ncrs.automaton.nca",
    "Controller": "ncrs.automaton.control",
    "Elite": "ncrs.runs.elites",
    "EliteArchive": "ncrs.runs.elites",
    "Evaluation": "ncrs.engines.base",
    "GenomeError": "ncrs.automaton.channels",
    "NCAPopulation": "ncrs.automaton.nca",
    "TrainedRun": "ncrs.training.api",
    "champions": "ncrs.runs.published",
    "convert_keras_genome": "ncrs.automaton.keras_order",
    "convert_to_keras": "ncrs.automaton.keras_order",
    "evaluate": "ncrs.engines.evaluate",
    "grow": "ncrs.automaton.growth",
    "grow_to": "ncrs.automaton.grow_to",
    "regrow_to": "ncrs.automaton.regrow_to",
    "load_archive": "ncrs.runs.elites",
    "load_champion": "ncrs.runs.published",
    "load_elite": "ncrs.runs.elites",
    "register_engine": "ncrs.engines.base",
    "register_objective": "ncrs.evolution.objective",
    "register_optimizer": "ncrs.evolution.optimizers.registry",
    "register_search_space": "ncrs.evolution.space",
    "train": "ncrs.training.api",
}

__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
