"""Random streams in compiled code: the numbers of numpy's own generators."""

import numpy as np
import pytest

from ncrs_envs.batched.streams import (
    STREAM_SIZE,
    next_integer,
    next_number,
    seed_stream,
    seed_words,
)


@pytest.mark.parametrize("key", [(), (0,), (3, 0, 2**32 - 1), (5, 1, 4, 1, 5)])
@pytest.mark.parametrize("entropy", [0, 7, 2**32, 2**53 - 1, 2**128 - 1, 2**150 + 9])
def test_numbers_are_those_of_a_generator(entropy, key):
    generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence(entropy, spawn_key=key)))
    stream = np.empty(STREAM_SIZE, dtype=np.uint64)
    seed_stream(np.array([*seed_words(entropy), *key], dtype=np.uint64), stream)
    for low, high in ((0, 4), (5, 20), (0, 1000), (-3, 0), (0, 2**31 + 5), (0, 3)):
        # An odd number of integers leaves half of a 64-bit number over.
        assert next_number(stream) == generator.random()
        drawn = [next_integer(stream, low, high) for _ in range(3)]
        assert drawn == generator.integers(low, high, size=3).tolist()
