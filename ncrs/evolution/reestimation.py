"""Estimate elites' fitness again: without it a lucky draw stays in the archive forever."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncrs.engines.base import Engine, StopCheck
from ncrs.evolution.archive import Archive
from ncrs.evolution.standstill import standing_still_fitness
from ncrs_envs.scenario import Scenario

# Genomes per call of the engine: bounds its memory, and the delay of a stop.
_CHUNK = 256


class Reestimation(NamedTuple):
    """What a new estimate of an archive's elites tells, beside the archive itself."""

    dropped: int
    """Number of elites that were dropped."""
    qd_score_error: float
    """Standard error of the QD-score per triple: all elites share the scenarios, of which some are
    easier than others. NaN for a single scenario."""


def reestimate(
    archive: Archive,
    engine: Engine,
    scenarios: Sequence[Scenario],
    seeds: NDArray[np.int64],
    should_stop: StopCheck | None = None,
) -> Reestimation:
    """Evaluate all elites on the same fresh scenarios, and replace their estimates.

    Elites keep their cells; one whose new fitness is NaN is dropped.

    Args:
        archive: Archive to change in place, once all its elites are evaluated.
        engine: Engine for the archive's task.
        scenarios: E fresh scenarios.
        seeds: Seed and keys of the scenarios' random stream, ``(4,)``, see ``Archive.add``.
        should_stop: Function that is polled now and then; True ends the evaluation.

    Raises:
        ArchiveError: If an estimate is infinite. The archive is unchanged then.
        EngineError: If a worker was lost.
        EvaluationInterrupted: If ``should_stop`` returned True.
    """
    genomes = archive.column("genomes")
    if not len(genomes):
        return Reestimation(0, 0.0)
    parts = [
        engine.evaluate(genomes[first : first + _CHUNK], scenarios, should_stop)
        for first in range(0, len(genomes), _CHUNK)
    ]
    archive.replace_estimates(
        np.concatenate([part.fitness for part in parts]),
        np.concatenate([part.success.mean(axis=1) for part in parts]),
        standing_still_fitness(engine.settings, scenarios),
        seeds,
    )
    of_scenarios = np.concatenate([part.episode_fitness for part in parts]).sum(axis=0)
    error = math.nan
    if len(scenarios) > 1:
        error = float(np.std(of_scenarios, ddof=1) / len(scenarios) ** 0.5)
    return Reestimation(len(genomes) - len(archive), error / len(archive.space.triples))
