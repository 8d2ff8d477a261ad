"""Random streams of many environments, which are numpy generators for those who ask for them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.streams import (
    STREAM_SIZE,
    generator_state,
    read_generator,
    seed_stream,
    seed_words,
)


class EnvStreams:
    """A stream for each environment, seeded as ``gymnasium.utils.seeding.np_random`` does.

    A stream that was handed out as a generator stays that generator, which others may use, too.
    The rest are numbers that kernels read, a hundred times as fast.
    """

    def __init__(self, count: int) -> None:
        self._streams = np.zeros((count, STREAM_SIZE), dtype=np.uint64)
        self._seeds: list[int | None] = [None] * count
        self._handed_out: dict[int, np.random.Generator] = {}

    def seed(self, seeds: Mapping[int, int]) -> None:
        """Seed environments."""
        for env, seed in seeds.items():
            seed_stream(np.array(seed_words(seed), dtype=np.uint64), self._streams[env])
            self._seeds[env] = seed
            self._handed_out.pop(env, None)

    def _seed_rest(self, envs: Sequence[int]) -> None:
        """Seed those of the environments that have no seed, with numbers that nobody knows."""
        without = [env for env in envs if self._seeds[env] is None]
        self.seed({env: _entropy() for env in without})

    def seed_of(self, env: int) -> int:
        """Return the seed of an environment."""
        self._seed_rest([env])
        seed = self._seeds[env]
        assert seed is not None
        return seed

    def generator(self, env: int) -> np.random.Generator:
        """Return an environment's stream as a generator, the same one whenever it is asked for."""
        self._seed_rest([env])
        if env not in self._handed_out:
            generator = np.random.Generator(np.random.PCG64())
            generator.bit_generator.state = generator_state(self._streams[env])
            self._handed_out[env] = generator
        return self._handed_out[env]

    def take(self, envs: Sequence[int]) -> NDArray[np.uint64]:
        """Return copies of the streams of environments, ``(len(envs), STREAM_SIZE)``."""
        self._seed_rest(envs)
        for env in self._handed_out.keys() & set(envs):
            self._streams[env] = read_generator(self._handed_out[env])
        return self._streams[envs]

    def put(self, envs: Sequence[int], streams: NDArray[np.uint64]) -> None:
        """Put streams back that have been used."""
        self._streams[envs] = streams
        for env in self._handed_out.keys() & set(envs):
            state = generator_state(self._streams[env])
            self._handed_out[env].bit_generator.state = state


def _entropy() -> int:
    drawn: Any = np.random.SeedSequence().entropy
    return int(drawn)
