"""A quality-diversity problem without robots, whose best fitness is known for every triple."""

from __future__ import annotations

import numpy as np

from ncrs.evolution.archive import Archive, MeasureSpace

DIMENSION = 12
SPACE = MeasureSpace(min_sensors=1, min_wheels=2, max_cells=16)  # 560 triples
_CENTRE = np.array([3.0, 5.0, 12.0])
_WIDTH = 4.0


def measures(genomes):
    """Measures that the first three weights choose, ``(P, 3)``; -1 where they are impossible.

    Each weight moves one measure away from (2, 3, 8), by one per 0.25.
    """
    triples = np.round(genomes[:, :3] / 0.25 + (2, 3, 8)).astype(np.int64)
    possible = SPACE.cells(triples) >= 0
    return np.where(possible[:, None], triples, -1)


def best_fitness(triples):
    """Maximum fitness of genomes with these measures, ``(P,)``.

    One peak in the middle of the measures: a search for fitness alone ends there.
    """
    distance = ((triples - _CENTRE) ** 2).sum(axis=1)
    return 0.2 + 0.8 * np.exp(-distance / (2 * _WIDTH**2))


def fitness(genomes):
    """``best_fitness`` of the measures times ``exp(-|rest - aim|^2)``, 0 if they are impossible.

    The aim of the other weights shifts with the triple, so that every cell has to be learned.
    """
    triples = measures(genomes)
    aim = 0.05 * triples.sum(axis=1, keepdims=True) - 0.5
    quality = np.exp(-((genomes[:, 3:] - aim) ** 2).sum(axis=1))
    return np.where(triples[:, 0] >= 0, best_fitness(triples) * quality, 0.0)


def make_archive():
    """Make an empty archive for the problem."""
    return Archive(SPACE, DIMENSION, grid_size=4)


def advance(optimizer, archive, generations):
    """Run generations as training does."""
    for _ in range(generations):
        genomes = optimizer.ask()
        judge(optimizer, archive, genomes)


def judge(optimizer, archive, genomes):
    """Add a population to the archive and tell it."""
    values = fitness(genomes)
    bodies = np.zeros((len(genomes), 4, 4), dtype=np.int8)
    added = archive.add(genomes, values, measures(genomes), bodies)
    optimizer.tell(values, added)
