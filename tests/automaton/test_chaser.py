"""The chaser by hand."""

import numpy as np

import ncrs
from ncrs.automaton.chaser import BODY, FITNESS, TASK, chaser_genome
from ncrs_envs.body import parse_body


def test_it_grows_its_body_and_reaches_every_light():
    genome = chaser_genome()
    body = ncrs.grow(ncrs.NCA(TASK).set_genome(genome))
    np.testing.assert_array_equal(body, parse_body(BODY))
    result = ncrs.evaluate(genome, TASK, episodes=40, engine="batched")
    assert result.success.all()
    assert abs(result.fitness[0] - FITNESS) < 0.01
