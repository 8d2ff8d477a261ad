"""Archive panels, colours and strips, to the pixel."""

import numpy as np

from ncrs.viz.archive_grid import archive_grid
from ncrs.viz.stills import Lettering, heatmaps, ramp, strip, write
from ncrs_envs.body import parse_body
from ncrs_envs.canvas import GRID, GROUND, SIGNED

TRIPLES = np.array([[1, 2, 3], [1, 2, 4], [1, 3, 4], [2, 2, 4]])


def test_the_grid_has_a_panel_for_each_number_of_cells():
    grid = archive_grid(np.array([[1, 3, 4]]), np.array([0.5]), TRIPLES)
    np.testing.assert_array_equal(grid.cells, [3, 4])
    assert grid.values.shape == (2, 3, 4)
    assert np.argwhere(~np.isnan(grid.values)).tolist() == [[1, 1, 3]]
    assert grid.values[1, 1, 3] == 0.5
    assert grid.possible.sum() == 4


def test_the_ramp_ends_where_viridis_does():
    colors = ramp(np.array([-1.0, 0.0, 1.0, 9.0]), 0.0, 1.0)
    assert colors.tolist() == [[68, 1, 84], [68, 1, 84], [253, 231, 37], [253, 231, 37]]
    assert ramp(np.array([0.5]), 0.5, 0.5).tolist() == [[68, 1, 84]]


def test_zero_is_white_on_the_signed_scale():
    colors = ramp(np.array([-9.0, 0.0, 0.5, 1.0]), -1.0, 1.0, SIGNED)
    assert colors.tolist() == [[8, 64, 129], [247, 247, 247], [241, 150, 70], [127, 59, 8]]


def test_heatmaps_show_sensors_to_the_right_and_wheels_upwards():
    grid = archive_grid(np.array([[1, 3, 4]]), np.array([0.5]), TRIPLES)
    picture = heatmaps(grid, 0.0, 0.5, columns=2, pixels=4)
    yellow = np.argwhere((picture == (253, 231, 37)).all(axis=-1))
    assert len(yellow) == 16
    top, left = yellow.min(axis=0)
    assert left == (3 * 4 + 6) + 4  # second panel, sensors = 1
    assert top == 12 + 6  # the uppermost row: wheels = 3
    assert picture[top + 4, left].tolist() == list(GRID)  # wheels = 2: possible, and empty
    assert picture[top + 8, left].tolist() == list(GROUND)


def test_a_strip_has_a_place_for_every_body():
    body = parse_body(["L#L", "W#W", "W#W"])
    picture = strip([body, body, body], ["a", "b", "c"], side=64)
    assert picture.shape == (64 + 30, 3 * 70 - 6, 3)
    np.testing.assert_array_equal(picture[:64, :64], picture[:64, 140:204])
    assert picture[64:, :64].max() > 200


def test_text_is_written_on_a_copy():
    blank = np.zeros((20, 40, 3), dtype=np.uint8)
    assert write(blank, (2, 2), "text", Lettering(12)).max() > 200
    assert blank.max() == 0
