"""The import of pycma, without its warnings about packages that only its own figures need."""

from __future__ import annotations

import warnings

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import cma
    from cma.interfaces import StatisticalModelSamplerWithZeroMeanBaseClass
    from cma.sigma_adaptation import CMAAdaptSigmaCSA, CMAAdaptSigmaTPA
    from cma.utilities.math import Mh
    from cma.utilities.utils import ElapsedWCTime

__all__ = [
    "CMAAdaptSigmaCSA",
    "CMAAdaptSigmaTPA",
    "ElapsedWCTime",
    "Mh",
    "StatisticalModelSamplerWithZeroMeanBaseClass",
    "cma",
]
