"""Estimate elites' fitness again: without it a lucky draw stays in the archive forever."""

from __future__ import annotations

import numpy as np

from ncrs.engines.base import Engine, StopCheck
from ncrs.evolution.archive import SEED_LENGTH, Archive
from ncrs.evolution.standstill import standing_still_fitness
from ncrs_envs.mirroring import PLAIN_SAMPLING, ScenarioSampling

# Genomes per call of the engine: bounds its memory, and how long a stop has to wait.
_CHUNK = 256


def seed_row(stream: np.random.SeedSequence) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Entropy and spawn key of a stream as an archive keeps them, int64 ``(4,)``."""
    assert isinstance(stream.entropy, int)
    numbers = [stream.entropy, *stream.spawn_key]
    return np.array(numbers + [-1] * (SEED_LENGTH - len(numbers)), dtype=np.int64)


def reestimate(
    archive: Archive,
    engine: Engine,
    stream: np.random.SeedSequence,
    episodes: int,
    should_stop: StopCheck | None = None,
    sampling: ScenarioSampling = PLAIN_SAMPLING,
) -> int:
    """Evaluate all elites on the same fresh scenarios, and keep those estimates instead.

    Elites stay where they are; one whose fitness comes out NaN is dropped.

    Args:
        archive: changed in place, only after all elites were evaluated.
        engine: of the archive's task.
        stream: of the scenarios.
        episodes: number of scenarios.
        should_stop: polled now and then; True ends the evaluation.
        sampling: how the scenarios are drawn.

    Returns:
        How many elites were dropped.

    Raises:
        ArchiveError: an estimate is infinite; the archive is as it was.
        EngineError: a worker was lost.
        EvaluationInterrupted: ``should_stop`` returned True.
    """
    settings = engine.settings
    scenarios = sampling.draw(settings.task, stream, episodes, settings.grid_size)
    genomes = archive.column("genomes")
    if not len(genomes):
        return 0
    parts = [
        engine.evaluate(genomes[first : first + _CHUNK], scenarios, should_stop)
        for first in range(0, len(genomes), _CHUNK)
    ]
    archive.replace_estimates(
        np.concatenate([part.fitness for part in parts]),
        np.concatenate([part.success.mean(axis=1) for part in parts]),
        standing_still_fitness(settings, scenarios),
        seed_row(stream),
    )
    return len(genomes) - len(archive)
