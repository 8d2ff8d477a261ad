"""Scenario and settings records."""

import numpy as np

from ncrs_envs import Scenario, sample_scenarios
from ncrs_envs.batched import layout
from ncrs_envs.batched.records import quad_capacity, scenario_arrays, settings_array
from ncrs_envs.scenario import wall_quads
from ncrs_envs.tasks import TaskSettings


def _quads(row):
    count = int(row[layout.SCENARIO_QUADS])
    table = row[layout.SCENARIO_HEADER :][: count * layout.QUAD_SIZE]
    return table.reshape(count, layout.QUAD_SIZE)


def _points(quad):
    corners = int(quad[layout.QUAD_CORNERS])
    return quad[layout.QUAD_POINTS :][: 2 * corners].reshape(corners, 2)


def test_settings():
    row = settings_array(TaskSettings("carry_ball", 7, "inverse_square", 3.0))
    assert row.tolist() == [70.0, 1.0, 3.0, 1.0]
    assert settings_array(TaskSettings("obstacle")).tolist() == [60.0, 0.0, 20.0, 0.0]


def test_points():
    row = scenario_arrays([Scenario(start=(1, 2), ball=(3, 4), target=(5, 6))], 5)[0]
    assert row[:6].tolist() == [1, 2, 3, 4, 5, 6]
    row = scenario_arrays([Scenario(start=(1, 2), light=(3, 4))], 5)[0]
    assert row[:4].tolist() == [1, 2, 3, 4]
    assert np.isnan(row[4:6]).all()
    assert row[layout.SCENARIO_QUADS] == 0


def test_walls_are_sorted_convex_and_cover_the_quads():
    scenarios = sample_scenarios("obstacle", seed=1, n=40)
    rows = scenario_arrays(scenarios, 5)
    assert rows.shape == (40, layout.scenario_size(quad_capacity(scenarios)))
    for row, scenario in zip(rows, scenarios, strict=True):
        quads = _quads(row)
        assert np.all(np.diff(quads[:, layout.QUAD_LOW_Y]) >= 0)
        expected = [q for q in wall_quads(scenario, 5) if np.ptp(q, axis=0).min() > 0.01]
        assert len(quads) == len(expected)
        for quad in quads:
            points = _points(quad)
            following = np.roll(points, -1, axis=0)
            (a_x, a_y), (b_x, b_y) = (following - points).T, (np.roll(points, -2, 0) - following).T
            turns = a_x * b_y - a_y * b_x
            assert np.all(turns > 0)
            low, high = points.min(axis=0), points.max(axis=0)
            assert quad[: layout.QUAD_CORNERS].tolist() == [low[1], high[1], low[0], high[0]]
            match = [q for q in expected if np.isin(points, q).all() and q[:, 1].min() == low[1]]
            assert match
            # Every corner of the quad it stands for is behind or on each of its edges.
            edges = quad[layout.QUAD_EDGES :][: 3 * len(points)].reshape(-1, 3)
            assert np.allclose(np.hypot(edges[:, 0], edges[:, 1]), 1.0)
            behind = [q @ edges[:, :2].T - edges[:, 2] <= 1e-9 for q in match]
            assert any(b.all() for b in behind)


def test_a_quad_that_crosses_itself_becomes_its_hull():
    limit = 66.0
    # The first corner lies beyond the wall's outer side at x = -66.
    walls = ([(-70.0, -60.0), (-20.0, 0.0)], [(limit, -60.0), (20.0, 0.0)])
    row = scenario_arrays([Scenario(start=(0, -51), light=(0, 36), walls=walls)], 5)[0]
    points = _points(_quads(row)[0])
    assert sorted(points.tolist()) == [[-70.0, -60.0], [-66.0, -60.0], [-66.0, 0.0], [-20.0, 0.0]]


def test_flat_quads_are_left_out():
    walls = ([(-66.0, -60.0), (-30.0, -60.0), (-20.0, 0.0)], [(66.0, -60.0), (20.0, 0.0)])
    row = scenario_arrays([Scenario(start=(0, -51), light=(0, 36), walls=walls)], 5)[0]
    assert row[layout.SCENARIO_QUADS] == 2
