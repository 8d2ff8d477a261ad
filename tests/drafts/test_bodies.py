"""Bodies drawn for given measures."""

import numpy as np
import pytest

from ncrs.drafts.bodies import draw_body
from ncrs.runs.elites import measure_space
from ncrs_envs.body import Cell, body_measures
from ncrs_envs.tasks import TASKS


@pytest.mark.parametrize(("task", "size"), [*((task, 5) for task in TASKS), ("carry_ball", 4)])
def test_every_triple_gets_valid_bodies(task, size):
    """Every eighth triple, twice."""
    generator = np.random.default_rng(0)
    triples = np.repeat(measure_space(TASKS[task], size).triples[::8], 2, axis=0)
    bodies = np.stack([draw_body(TASKS[task], triple, size, generator) for triple in triples])
    np.testing.assert_array_equal(body_measures(bodies), triples)
    assert TASKS[task].is_valid(bodies).all()


def test_most_have_a_hub_between_two_light_sensors():
    generator = np.random.default_rng(0)
    bodies = [draw_body(TASKS["light_chase"], (2, 8, 12), 5, generator) for _ in range(100)]
    hubs = 0
    for body in bodies:
        light = body == Cell.LIGHT_SENSOR
        hubs += bool((light[:, 1] & light[:, 3] & (body[:, 2] > 0)).any())
    assert 60 <= hubs <= 80  # the others are arrows


def test_one_seed_gives_one_body():
    first, second = (
        draw_body(TASKS["carry_ball"], (4, 6, 15), 5, np.random.default_rng(3)) for _ in range(2)
    )
    np.testing.assert_array_equal(first, second)
