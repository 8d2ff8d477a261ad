"""Grow a modular robot from one cell, and drive it, with one neural cellular automaton."""

from ncrs.control import Controller
from ncrs.development import grow
from ncrs.elites import Elite, EliteArchive, load_archive, load_elite
from ncrs.engines import Evaluation
from ncrs.evaluation import evaluate
from ncrs.layout import GenomeError
from ncrs.nca import NCA, NCAPopulation
from ncrs.published import champions, load_champion

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
