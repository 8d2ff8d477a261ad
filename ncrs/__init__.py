"""Grow a modular robot from one cell, and drive it, with one neural cellular automaton."""

from ncrs.automaton.channels import GenomeError
from ncrs.automaton.control import Controller
from ncrs.automaton.growth import grow
from ncrs.automaton.nca import NCA, NCAPopulation
from ncrs.engines import Evaluation
from ncrs.engines.evaluate import evaluate
from ncrs.runs.elites import Elite, EliteArchive, load_archive, load_elite
from ncrs.runs.published import champions, load_champion

__version__ = "0.1.0"

__all__ = [
    "NCA",
    "Controller",
    "Elite",
    "EliteArchive",
    "Evaluation",
    "GenomeError",
    "NCAPopulation",
    "champions",
    "evaluate",
    "grow",
    "load_archive",
    "load_champion",
    "load_elite",
]
