"""Streams of environments: numpy's, whoever draws from them."""

import numpy as np
from gymnasium.utils import seeding

from ncrs_envs.batched.env_streams import EnvStreams
from ncrs_envs.batched.sampling import RANDOM_REGION, Sample
from ncrs_envs.scenario import NOISE, sample_scenario
from ncrs_envs.tasks import CARRY_BALL


def drawn(streams, envs):
    """Draw a CarryBall scenario from each stream, whose integers leave half a number over."""
    own = streams.take(envs)
    sample = Sample(CARRY_BALL, own, np.full(len(envs), RANDOM_REGION), 5, NOISE)
    streams.put(envs, own)
    return [sample[i] for i in range(len(envs))]


def test_scenarios_and_others_draw_from_one_generator():
    streams = EnvStreams(3)
    streams.seed({0: 5, 1: 2**70, 2: 0})
    expected = [seeding.np_random(seed)[0] for seed in (5, 2**70, 0)]
    handed_out = streams.generator(1)
    for _ in range(3):
        envs = [2, 1]
        assert drawn(streams, envs) == [sample_scenario(CARRY_BALL, expected[env]) for env in envs]
        assert handed_out.integers(9) == expected[1].integers(9)
    assert streams.generator(1) is handed_out
    assert streams.generator(0).bit_generator.state == expected[0].bit_generator.state
    assert [streams.seed_of(env) for env in range(3)] == [5, 2**70, 0]


def test_a_new_seed_begins_a_new_stream():
    streams = EnvStreams(1)
    streams.seed({0: 5})
    before = streams.generator(0)
    streams.seed({0: 5})
    assert streams.generator(0) is not before
    assert streams.generator(0).random() == before.random()


def test_without_a_seed_all_streams_differ():
    streams = EnvStreams(2)
    first, second = (streams.generator(env).random() for env in range(2))
    assert first != second
    assert EnvStreams(1).generator(0).random() not in (first, second)
    assert seeding.np_random(streams.seed_of(0))[0].random() == first
