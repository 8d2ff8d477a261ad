"""Bodies for many environments at once, in every notation."""

import numpy as np
import pytest

from ncrs_envs.bodies import check_bodies, grid_side
from ncrs_envs.body import BodyError, body_to_characters
from ncrs_envs.tasks import LIGHT_CHASE

BODIES = np.array(
    [
        [[2, 1, 2], [4, 1, 4], [0, 1, 0]],
        [[2, 0, 2], [4, 1, 4], [4, 0, 4]],
        [[2, 2, 2], [1, 1, 1], [4, 1, 4]],
    ],
    dtype=np.int8,
)
TEXTS = [body_to_characters(body) for body in BODIES]
ALL = np.ones(3, dtype=bool)


@pytest.mark.parametrize(
    "bodies",
    [
        BODIES,
        BODIES.tolist(),
        list(BODIES),
        TEXTS,
        tuple(text.replace("\n", "/") for text in TEXTS),
        np.array([text.replace("\n", "/") for text in TEXTS]),
        [text.splitlines() for text in TEXTS],
        [[" ".join(row) for row in text.splitlines()] for text in TEXTS],
        [BODIES[0], BODIES[1].tolist(), TEXTS[2]],
    ],
    ids=[
        "array", "lists", "list of arrays", "texts", "slashes", "array of texts", "rows",
        "spaced rows", "mixed",
    ],
)  # fmt: skip
def test_a_body_for_each_in_every_notation(bodies):
    assert grid_side(bodies) == 3
    np.testing.assert_array_equal(check_bodies(bodies, LIGHT_CHASE, 3, ALL), BODIES)
    mask = np.array([False, True, True])
    np.testing.assert_array_equal(check_bodies(bodies, LIGHT_CHASE, 3, mask), BODIES[1:])


@pytest.mark.parametrize(
    "body",
    [BODIES[0], BODIES[0].tolist(), TEXTS[0], TEXTS[0].splitlines(), ["L # L", "W # W", ". # ."]],
    ids=["array", "lists", "text", "rows", "spaced rows"],
)
def test_one_body_for_all_in_every_notation(body):
    assert grid_side(body) == 3
    np.testing.assert_array_equal(check_bodies(body, LIGHT_CHASE, 3, ALL), BODIES[:1])


@pytest.mark.parametrize(
    ("bodies", "message"),
    [
        ([TEXTS[0], TEXTS[1], "L#L/W#W"], "Environment 2: .*square"),
        ([*BODIES[:2].tolist(), [[2, 1, 2], [4, 1], [0]]], "Environment 2: .*differ in length"),
        ([BODIES[0], np.zeros((5, 5), dtype=int), BODIES[1]], "Environment 1: .*must be 3 x 3"),
        ([[[2, 1, 2], [4, 1]], *BODIES[1:].tolist()], "Environment 0: .*differ in length"),
        ([TEXTS[0], None, TEXTS[1]], "Environment 1: .*dtype object"),
        ([TEXTS[0], TEXTS[1], "LLL/###/W##"], "Environment 2: .*2 wheels"),
        (TEXTS[:2], "each of 3 environments.*got 2"),
        ([[[2, 1, 2], [4, 1]]], "each of 3 environments.*got 1"),
        ([["L", "#", "L"], ["W", "#", "W"], ["W", "#", "W"]], "rows of characters"),
    ],
)
def test_malformed_bodies_are_refused_with_their_environment(bodies, message):
    with pytest.raises(BodyError, match=message):
        check_bodies(bodies, LIGHT_CHASE, 3, ALL)


def test_bodies_outside_the_mask_are_not_read():
    mask = np.array([True, False, True])
    bodies = [BODIES[0], "not a body", BODIES[2]]
    np.testing.assert_array_equal(check_bodies(bodies, LIGHT_CHASE, 3, mask), BODIES[[0, 2]])
