"""Random streams: their keys, and rows that name them."""

import numpy as np
import pytest

from ncrs.runs.seeds import (
    MAX_SEED,
    SeedError,
    Stream,
    row_numbers,
    row_sequence,
    seed_row,
    seed_sequence,
)


def test_keys_are_those_of_all_archives_so_far():
    assert {stream.name: stream.value for stream in Stream.__members__.values()} == {
        "OPTIMIZER": 0,
        "SCENARIOS": 1,
        "CHAMPION": 2,
        "ASSESSMENT": 3,
        "REESTIMATION": 4,
        "COMMAND_REESTIMATION": 5,
        "REPORT": 6,
    }
    assert len(Stream) == len(Stream.__members__) == 7  # no two names of one key


@pytest.mark.parametrize(
    ("stream", "keys", "spawn_key"),
    [
        (Stream.OPTIMIZER, (), (0,)),
        (Stream.SCENARIOS, (7,), (1, 7)),
        (Stream.SCENARIOS, (7, 111), (1, 7, 111)),
        (Stream.CHAMPION, (), (2,)),
        (Stream.ASSESSMENT, (), (3,)),
        (Stream.REESTIMATION, (500,), (4, 500)),
        (Stream.COMMAND_REESTIMATION, (), (5,)),
        (Stream.REPORT, (), (6,)),
    ],
)
@pytest.mark.parametrize("seed", [0, 5, MAX_SEED])
def test_streams_and_their_rows(seed, stream, keys, spawn_key):
    sequence = seed_sequence(seed, stream, *keys)
    expected = np.random.SeedSequence(seed, spawn_key=spawn_key).generate_state(8)
    np.testing.assert_array_equal(sequence.generate_state(8), expected)
    row = seed_row(sequence)
    assert (row.dtype, row.shape) == (np.int64, (4,))
    assert row.tolist() == [seed, *spawn_key, *[-1] * (3 - len(spawn_key))]
    assert row_numbers(row) == (seed, *spawn_key)
    for form in (row, row_numbers(row)):
        again = row_sequence(form)
        assert (again.entropy, again.spawn_key) == (seed, spawn_key)
        np.testing.assert_array_equal(again.generate_state(8), expected)


def test_streams_of_one_seed_are_independent():
    states = {seed_sequence(3, stream).generate_state(4).tobytes() for stream in Stream}
    assert len(states) == len(Stream)


@pytest.mark.parametrize("seed", [-1, MAX_SEED + 1, 1.0, True, "1", None])
def test_seeds_out_of_range(seed):
    with pytest.raises(SeedError, match=r"seed must be an integer from 0 to 9223372036854775807"):
        seed_sequence(seed, Stream.OPTIMIZER)


def test_rows_that_name_no_stream():
    with pytest.raises(SeedError, match="at most 3 keys"):
        seed_row(np.random.SeedSequence(1, spawn_key=(1, 2, 3, 4)))
    with pytest.raises(SeedError, match="seed must be an integer"):
        seed_row(np.random.SeedSequence([1, 2]))
    for row in [(-1, -1, -1, -1), (3, -2, 1, -1)]:
        with pytest.raises(SeedError, match="Expected a seed and keys"):
            row_sequence(row)
