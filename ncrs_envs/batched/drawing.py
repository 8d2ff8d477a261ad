"""Scenarios of whole populations, each genome with its own, drawn at once in compiled code."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.dtypes import assign
from ncrs_envs.batched.layout import Scenario as ScenarioRecord
from ncrs_envs.batched.layout import Scenarios, make_scenarios
from ncrs_envs.batched.sampling import MAX_QUADS, Sample
from ncrs_envs.batched.streams import STREAM_SIZE, WORD, Words, seed_stream, seed_words
from ncrs_envs.cores import available_cores
from ncrs_envs.drawing import DrawnRows, Keys, ScenarioRecipe, draw_scenarios
from ncrs_envs.mirroring import STANDARD, ScenarioSampling, images_and_regions
from ncrs_envs.scenario import Scenario
from ncrs_envs.tasks import BUILT_IN, Task, TaskSettings

_ROWS = 64
"""Number of rows that a thread draws at a time."""


def draw_rows(  # noqa: PLR0913 - as for one row, with the two parts of a seed
    sampling: ScenarioSampling,
    settings: TaskSettings,
    seed: int,
    keys: Keys,
    episodes: int,
    generation: int | None = None,
) -> Sequence[Sequence[Scenario]]:
    """Draw one row of scenarios for every key, as ``drawing.draw_scenarios`` does for one.

    Tasks, samplings and curricula of users, perturbations, and mirror images of walls are drawn one
    by one, which takes a hundred times as long.

    Args:
        sampling: Settings of the sampling.
        settings: Task and its settings.
        seed: Entropy of all rows.
        keys: Spawn key of each row.
        episodes: Number of scenarios of a row.
        generation: As in ``ScenarioSampling.draw``.

    Raises:
        ScenarioError: ``episodes`` is not a positive integer, or the sampling is out of range.
    """
    sampling.check()
    is_compiled = _is_compiled(sampling, settings.task, generation) and _are_words(keys)
    if episodes < 1 or not is_compiled:
        seeds = (np.random.SeedSequence(seed, spawn_key=key) for key in keys)
        return [draw_scenarios(sampling, settings, own, episodes, generation) for own in seeds]
    n = settings.grid_size
    recipe = ScenarioRecipe(settings.name, n, episodes, sampling, seed, (), generation)
    return DrawnRows(recipe, keys, _draw(sampling, settings, _words(seed, keys), episodes))


def draw_recipes(recipes: Sequence[ScenarioRecipe]) -> Sequence[Sequence[Scenario]]:
    """Draw the scenarios of recipes, at once where they differ in their spawn keys alone."""
    first, keys = recipes[0], [recipe.spawn_key for recipe in recipes]
    if len(recipes) == 1 or any(replace(recipe, spawn_key=keys[0]) != first for recipe in recipes):
        return [recipe.draw() for recipe in recipes]
    settings = TaskSettings(first.task, first.grid_size)
    return draw_rows(
        first.sampling, settings, first.entropy, keys, first.episodes, first.generation
    )


def _is_compiled(sampling: ScenarioSampling, task: Task, generation: int | None) -> bool:
    """Return True if the kernels here draw all of it."""
    return (
        sampling.kind == STANDARD
        and task in BUILT_IN
        and sampling.ease(generation) == 0.0
        and not sampling.perturbations.at(generation).is_any
        and not (task.has_walls and sampling.mirroring != "none")
    )


def _are_words(keys: Keys) -> bool:
    """Return True if every number is one word, and all keys have equally many."""
    return len(set(map(len, keys))) == 1 and all(number < WORD for key in keys for number in key)


def _words(seed: int, keys: Keys) -> Words:
    """Return the words of each row's seed, ``(R, W)``; a key is one word."""
    start = np.array(seed_words(seed), dtype=np.uint64)
    numbers = np.array(keys, dtype=np.uint64).reshape(len(keys), -1)
    return np.hstack([np.tile(start, (len(keys), 1)), numbers])


def _draw(
    sampling: ScenarioSampling, settings: TaskSettings, words: Words, episodes: int
) -> Scenarios:
    """Draw all rows on all cores, records ``(R, E)``."""
    task, rows = settings.task, len(words)
    images, regions = images_and_regions(sampling.mirroring, task)
    signs, draws = np.array(images), -(-episodes // len(images))
    drawn = make_scenarios(rows * episodes, MAX_QUADS if task.has_walls else 0)
    shape = (rows, episodes)
    records = Scenarios(drawn.scenarios.reshape(shape), drawn.quads.reshape(*shape, -1))

    def draw_part(first: int) -> None:
        part = slice(first, first + _ROWS)
        streams = np.empty((len(words[part]) * draws, STREAM_SIZE), dtype=np.uint64)
        _seed_streams(words[part], draws, streams)
        chosen = np.resize(np.resize(regions, draws), len(streams))
        sample = Sample(task, streams, chosen, settings.grid_size, sampling.noise)
        _write_images(sample.records.scenarios, signs, records.scenarios[part])
        if task.has_walls:  # they have one image
            quads = sample.records.quads.reshape(-1, *records.quads.shape[1:])
            assign(records.quads, part, quads)

    with ThreadPoolExecutor(available_cores(), "ncrs-drawing") as pool:
        list(pool.map(draw_part, range(0, rows, _ROWS)))
    return records


@kernel
def _seed_streams(words: Words, draws: int, streams: NDArray[np.uint64]) -> None:
    """Seed the streams of so many draws for each row; a draw's number is the key's last word."""
    given = words.shape[1]
    own = np.empty(given + 1, dtype=np.uint64)
    for row in range(len(words)):
        own[:given] = words[row]
        for draw in range(draws):
            own[given] = np.uint64(draw)
            seed_stream(own, streams[row * draws + draw])


@kernel
def _write_images(
    drawn: NDArray[ScenarioRecord], signs: NDArray[np.float64], rows: NDArray[ScenarioRecord]
) -> None:
    """Write all images of what was drawn, row by row, as many as a row has room for."""
    images = len(signs)
    draws = len(drawn) // len(rows)
    for row in range(len(rows)):
        for episode in range(rows.shape[1]):
            source = drawn[row * draws + episode // images]
            record = rows[row, episode]
            x, y = signs[episode % images, 0], signs[episode % images, 1]
            record.start_x, record.start_y = x * source.start_x, y * source.start_y
            record.goal_x, record.goal_y = x * source.goal_x, y * source.goal_y
            record.target_x, record.target_y = x * source.target_x, y * source.target_y
            record.quad_count = source.quad_count
