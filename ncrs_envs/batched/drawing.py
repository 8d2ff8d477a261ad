"""Scenarios of whole populations, each genome with its own, drawn at once in compiled code."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel
from ncrs_envs.batched.layout import Scenario as ScenarioRecord
from ncrs_envs.batched.layout import Scenarios, make_scenarios
from ncrs_envs.batched.sampling import (
    COLUMNS,
    FIXED_VERTICES,
    MAX_QUADS,
    Draws,
    between,
    build_obstacles,
    is_blocked,
    make_draws,
    no_free_start,
    write_quads,
)
from ncrs_envs.batched.streams import (
    STREAM_SIZE,
    WORD,
    Stream,
    Words,
    next_integer,
    next_number,
    seed_stream,
    seed_words,
)
from ncrs_envs.cores import available_cores
from ncrs_envs.drawing import DrawnRows, Keys, draw_scenarios
from ncrs_envs.mirroring import STANDARD, ScenarioSampling, images_and_regions
from ncrs_envs.scenario import (
    CORNER_REGIONS,
    FAR,
    MAX_START_DRAWS,
    START_Y,
    WALL_VERTICES,
    Scenario,
)
from ncrs_envs.tasks import BUILT_IN, REGIONS, Task, TaskSettings, playfield

_CORNERS = np.array(CORNER_REGIONS)
_ROWS = 64
"""Number of rows that a thread draws at a time."""


class _Plan(NamedTuple):
    """What to draw, for kernels."""

    words: Words
    """Words of each row's seed, ``(R, W)``; the number of the draw follows them."""
    regions: NDArray[np.int64]
    """Regions of the draws of a row, which are repeated."""
    signs: NDArray[np.float64]
    """Images of each draw, ``(I, 2)``."""
    episodes: int
    """Number of scenarios of a row."""
    extent: float
    noise: float


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
        keys: Spawn key of each row, all of the same length, at least 1.
        episodes: Number of scenarios of a row.
        generation: As in ``ScenarioSampling.draw``.

    Raises:
        ScenarioError: ``episodes`` is not a positive integer, or the sampling is out of range.
    """
    sampling.check()
    is_compiled = _is_compiled(sampling, settings.task, generation)
    if episodes < 1 or not is_compiled or max(map(max, keys)) >= WORD:
        return [
            draw_scenarios(
                sampling,
                settings,
                np.random.SeedSequence(seed, spawn_key=key),
                episodes,
                generation,
            )
            for key in keys
        ]
    images, regions = images_and_regions(sampling.mirroring, settings.task)
    plan = _Plan(
        words=_words(seed, keys),
        regions=np.array(regions),
        signs=np.array(images),
        episodes=episodes,
        extent=playfield(settings.grid_size),
        noise=sampling.noise,
    )
    return DrawnRows(sampling, settings, seed, keys, _drawn(plan, settings), generation)


def _is_compiled(sampling: ScenarioSampling, task: Task, generation: int | None) -> bool:
    """Return True if the kernels here draw all of it."""
    return (
        sampling.kind == STANDARD
        and task in BUILT_IN
        and sampling.ease(generation) == 0.0
        and not sampling.perturbations.at(generation).is_any
        and not (task.has_walls and sampling.mirroring != "none")
    )


def _words(seed: int, keys: Keys) -> Words:
    """Return the words of each row's seed, ``(R, W)``; a key is one word."""
    start = np.array(seed_words(seed), dtype=np.uint64)
    numbers = np.array(keys, dtype=np.uint64).reshape(len(keys), -1)
    return np.hstack([np.tile(start, (len(keys), 1)), numbers])


def _drawn(plan: _Plan, settings: TaskSettings) -> Scenarios:
    """Draw all rows on all cores, records ``(R, E)``."""
    rows, has_walls = len(plan.words), settings.task.has_walls
    drawn = make_scenarios(rows * plan.episodes, MAX_QUADS if has_walls else 0)
    draw = _draw_obstacles if has_walls else _draw_points

    def draw_part(first: int) -> None:
        part = slice(first * plan.episodes, (first + _ROWS) * plan.episodes)
        words = plan.words[first : first + _ROWS]
        own = Scenarios(drawn.scenarios[part], drawn.quads[part])
        draw(plan._replace(words=words), settings, own)

    with ThreadPoolExecutor(available_cores(), "ncrs-drawing") as pool:
        list(pool.map(draw_part, range(0, rows, _ROWS)))
    shape = (rows, plan.episodes)
    return Scenarios(drawn.scenarios.reshape(shape), drawn.quads.reshape(*shape, -1))


def _draw_points(plan: _Plan, settings: TaskSettings, drawn: Scenarios) -> None:
    """Draw scenarios without walls."""
    _place_points(plan, settings.task.has_ball, drawn.scenarios)


def _draw_obstacles(plan: _Plan, settings: TaskSettings, drawn: Scenarios) -> None:
    """Draw scenarios with walls."""
    n, count = settings.grid_size, len(drawn.scenarios)
    draws, blocked = make_draws(count), np.empty(count, dtype=np.bool_)
    streams = np.empty((count, STREAM_SIZE), dtype=np.uint64)
    _draw_numbers(plan, streams, draws)
    build_obstacles(n, plan.extent, plan.noise, draws, drawn, blocked)
    if not _draw_starts_again(n, plan.extent, np.flatnonzero(blocked), streams, draws, drawn):
        raise no_free_start(n)


@kernel
def _seed(plan: _Plan, row: int, draw: int, stream: Stream) -> None:
    """Seed the stream of a draw."""
    given = plan.words.shape[1]
    words = np.empty(given + 1, dtype=np.uint64)
    words[:given] = plan.words[row]
    words[given] = np.uint64(draw)
    seed_stream(words, stream)


@kernel
def _place_points(plan: _Plan, has_ball: bool, records: NDArray[ScenarioRecord]) -> None:
    """Draw scenarios of a light or a ball, with their images."""
    stream = np.empty(STREAM_SIZE, dtype=np.uint64)
    images = len(plan.signs)
    reach, far = plan.noise * plan.extent, FAR * plan.extent
    for row in range(len(plan.words)):
        for draw in range(-(-plan.episodes // images)):
            _seed(plan, row, draw, stream)
            region = plan.regions[draw % len(plan.regions)]
            noise_x = between(-reach, reach, next_number(stream))
            noise_y = between(-reach, reach, next_number(stream))
            start_x, start_y = 0.0, 0.0
            goal_x = _CORNERS[region, 0] * FAR * plan.extent + noise_x
            goal_y = _CORNERS[region, 1] * FAR * plan.extent + noise_y
            target_x, target_y = np.nan, np.nan
            if has_ball:
                start_x = between(-far, far, next_number(stream))
                start_y = START_Y * plan.extent
                goal_x = COLUMNS[region] * plan.extent + noise_x
                goal_y = noise_y
                target_x = COLUMNS[next_integer(stream, 0, REGIONS)] * plan.extent
                target_y = far
            for image in range(min(images, plan.episodes - draw * images)):
                x, y = plan.signs[image, 0], plan.signs[image, 1]
                record = records[row * plan.episodes + draw * images + image]
                record.start_x, record.start_y = x * start_x, y * start_y
                record.goal_x, record.goal_y = x * goal_x, y * goal_y
                record.target_x, record.target_y = x * target_x, y * target_y


@kernel
def _draw_numbers(plan: _Plan, streams: NDArray[np.uint64], draws: Draws) -> None:
    """Draw the random numbers of scenarios with walls, each in the order of ``sample_scenario``."""
    for row in range(len(plan.words)):
        for episode in range(plan.episodes):
            i = row * plan.episodes + episode
            stream = streams[i]
            _seed(plan, row, episode, stream)
            draws.regions[i] = plan.regions[episode % len(plan.regions)]
            for place in range(3):
                draws.places[i, place] = next_number(stream)
            for side in range(2):
                count = next_integer(stream, WALL_VERTICES[0], WALL_VERTICES[1])
                draws.counts[i, side] = count
                for number in range(2 * (count - FIXED_VERTICES)):
                    draws.noise[i, side, number] = next_number(stream)
            draws.starts[i] = next_number(stream)


@kernel
def _draw_starts_again(  # noqa: PLR0913 - kernels take numbers
    grid_size: int,
    extent: float,
    chosen: NDArray[np.int64],
    streams: NDArray[np.uint64],
    draws: Draws,
    drawn: Scenarios,
) -> bool:
    """Draw the starts of scenarios until they are clear of the walls; False if one never is."""
    quads = np.empty((MAX_QUADS, 4, 2))
    for i in chosen:
        count = write_quads(extent, draws.counts[i], draws.vertices[i], quads)
        record: ScenarioRecord = drawn.scenarios[i]
        for attempt in range(1, MAX_START_DRAWS):
            x = between(-FAR * extent, FAR * extent, next_number(streams[i]))
            if not is_blocked(x, record.start_y, grid_size, quads[:count]):
                record.start_x = x
                break
            if attempt == MAX_START_DRAWS - 1:
                return False
    return True
