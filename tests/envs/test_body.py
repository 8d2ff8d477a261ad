"""Cell encoding, parsing of bodies, measures and cell positions."""

import numpy as np
import pytest

from ncrs_envs.body import (
    BodyError,
    Cell,
    body_measures,
    body_to_characters,
    cell_centers,
    check_grid_size,
    mass_properties,
    parse_body,
    sensor_mask,
    wheel_mask,
)

ROWS = ["L#T", "W.W", "###"]
CODES = [[2, 1, 3], [4, 0, 4], [1, 1, 1]]


@pytest.mark.parametrize(
    "body",
    [
        ROWS,
        tuple(ROWS),
        np.array(ROWS),
        [" ".join(row) for row in ROWS],
        "\n".join(ROWS),
        " ".join(ROWS),
        "/".join(ROWS),
        "\\n".join(ROWS),
        "\r\n".join(ROWS) + "\r\n",
        "\n".join("  " + " ".join(row) for row in ROWS) + "\n",
        " / ".join(" ".join(row) for row in ROWS),
        np.array("/".join(ROWS)),
        CODES,
        np.array(CODES),
        np.array(CODES, dtype=np.uint8),
    ],
    ids=[
        "rows", "tuple", "array of rows", "spaced rows", "text", "words", "slashes", "as in JSON",
        "CRLF", "spaced text", "spaced slashes", "array of text", "lists", "int64", "uint8",
    ],
)  # fmt: skip
def test_every_notation_gives_the_same_read_only_grid(body):
    grid = parse_body(body)
    assert grid.dtype == np.int8
    assert grid.tolist() == CODES
    with pytest.raises(ValueError, match="read-only"):
        grid[0, 0] = 0


def test_parsing_copies():
    source = np.array(CODES, dtype=np.int8)
    grid = parse_body(source)
    source[0, 0] = 0
    assert grid[0, 0] == Cell.LIGHT_SENSOR


def test_characters_are_the_inverse_of_parsing(rng):
    for _ in range(20):
        grid = rng.integers(0, 5, (5, 5)).astype(np.int8)
        assert np.array_equal(parse_body(body_to_characters(grid)), grid)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (np.zeros(25, dtype=int), r"2 axes.*got 1 with shape \(25,\)"),
        (np.zeros((1, 5, 5), dtype=int), "2 axes.*got 3"),
        (np.zeros((5, 4), dtype=int), "square.*got 5 x 4"),
        (np.zeros((2, 2), dtype=int), "at least 3 x 3, got 2 x 2"),
        (np.zeros((5, 5)), "dtype float64"),
        (np.full((5, 5), np.nan), "dtype float64"),
        (np.zeros((5, 5), dtype=bool), "dtype bool"),
        (np.full((5, 5), 6), r"unknown cell codes \[6\]"),
        (np.full((5, 5), -1), r"unknown cell codes \[-1\]"),
        ([[0, 1, 2], [0, 1], [0]], "rows differ in length"),
        (["...", "..", "..."], r"rows differ in length: \[3, 2, 3\].*empty cell as '\.'"),
        ("L L/W W/W W", "must be a square grid.*got 3 x 2"),
        ("L#L/W W/W#W", r"rows differ in length: \[3, 2, 3\]"),
        ("L # L", "got 3 x 1"),
        ("", "got an empty string"),
        (" \n / ", "got an empty string"),
        ([["L", "#"], ["W", "#"]], "rows of characters"),
        ([np.zeros((3, 3), dtype=int), np.zeros((2, 2), dtype=int)], "rows differ in length"),
        (["..x", "...", "..."], "unknown characters.*x"),
        (None, "dtype object"),
        ([], "dtype float64"),
        ({"a": 1}, "dtype object"),
    ],
)
def test_bad_bodies_are_refused_with_the_reason(body, message):
    with pytest.raises(BodyError, match=message):
        parse_body(body)


def test_another_grid_size_is_refused_with_both():
    with pytest.raises(BodyError, match="must be 5 x 5, got 3 x 3"):
        parse_body(CODES, 5)


@pytest.mark.parametrize("size", [2, 0, -3, 3.0, "5", True, None])
def test_bad_grid_sizes_are_refused(size):
    with pytest.raises(BodyError, match="grid_size must be"):
        check_grid_size(size)


def test_features_and_masks_of_a_batch():
    bodies = np.array([CODES, np.zeros((3, 3))], dtype=np.int8)
    assert body_measures(bodies).tolist() == [[2, 2, 8], [0, 0, 0]]
    assert sensor_mask(bodies)[0].tolist() == [[True, False, True], [False] * 3, [False] * 3]
    assert wheel_mask(bodies)[0].tolist() == [[False] * 3, [True, False, True], [False] * 3]


@pytest.mark.parametrize("n", [3, 4, 5, 9])
def test_cell_centres_have_their_origin_in_the_grids_middle(n):
    centers = cell_centers(n)
    for i in range(n):
        for j in range(n):
            assert tuple(centers[i, j]) == (2 * j - (n - 1), (n - 1) - 2 * i)


def test_mass_of_one_wheel_and_one_tissue_cell():
    body = parse_body(["#W.", "...", "..."])
    properties = mass_properties(body)
    assert properties.mass == pytest.approx(4.0 + 0.4)
    assert properties.center == pytest.approx((-2.0 * 4.0 / 4.4, 2.0))
    reduced = 4.0 * 0.4 / 4.4
    assert properties.inertia == pytest.approx(4.4 * 4.0 / 6.0 + reduced * 2.0**2)


def test_an_empty_body_has_no_mass():
    with pytest.raises(BodyError, match="no cells"):
        mass_properties(parse_body(np.zeros((3, 3), dtype=int)))
