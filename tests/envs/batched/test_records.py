"""Scenario and settings records."""

import numpy as np

from ncrs_envs import Scenario, sample_scenarios
from ncrs_envs.batched.records import quad_capacity, scenario_records, settings_record
from ncrs_envs.scenario import wall_quads
from ncrs_envs.tasks import TaskSettings


def _quads(rows, index=0):
    return list(rows.quads[index, : rows.scenarios[index].quad_count])


def _points(quad):
    corners = quad.corners[: quad.corner_count]
    return np.stack([corners["x"], corners["y"]], axis=1)


def test_settings():
    settings = settings_record(TaskSettings("carry_ball", 7, "inverse_square", 3.0))
    assert settings.extent == 70.0
    assert settings.inverse_square
    assert settings.success_radius == 3.0
    assert settings.has_ball
    settings = settings_record(TaskSettings("obstacle"))
    assert settings.extent == 60.0
    assert not settings.inverse_square
    assert settings.success_radius == 20.0
    assert not settings.has_ball


def test_points():
    row = scenario_records([Scenario(start=(1, 2), ball=(3, 4), target=(5, 6))], 5).scenarios[0]
    assert row.item() == (1, 2, 3, 4, 5, 6, 0)
    row = scenario_records([Scenario(start=(1, 2), light=(3, 4))], 5).scenarios[0]
    assert (row.start_x, row.start_y, row.goal_x, row.goal_y) == (1, 2, 3, 4)
    assert np.isnan([row.target_x, row.target_y]).all()
    assert row.quad_count == 0


def test_walls_are_sorted_convex_and_cover_the_quads():
    scenarios = sample_scenarios("obstacle", seed=1, n=40)
    rows = scenario_records(scenarios, 5)
    assert rows.scenarios.shape == (40,)
    assert rows.quads.shape == (40, quad_capacity(scenarios))
    for index, scenario in enumerate(scenarios):
        quads = _quads(rows, index)
        assert np.all(np.diff([quad.low_y for quad in quads]) >= 0)
        expected = [q for q in wall_quads(scenario, 5) if np.ptp(q, axis=0).min() > 0.01]
        assert len(quads) == len(expected)
        for quad in quads:
            points = _points(quad)
            following = np.roll(points, -1, axis=0)
            (a_x, a_y), (b_x, b_y) = (following - points).T, (np.roll(points, -2, 0) - following).T
            turns = a_x * b_y - a_y * b_x
            assert np.all(turns > 0)
            low, high = points.min(axis=0), points.max(axis=0)
            assert (quad.low_x, quad.low_y) == tuple(low)
            assert (quad.high_x, quad.high_y) == tuple(high)
            match = [q for q in expected if np.isin(points, q).all() and q[:, 1].min() == low[1]]
            assert match
            # Every corner of the quad it stands for is behind or on each of its edges.
            edges = quad.edges[: len(points)]
            normals = np.stack([edges["n_x"], edges["n_y"]])
            assert np.allclose(np.hypot(*normals), 1.0)
            behind = [q @ normals - edges["offset"] <= 1e-9 for q in match]
            assert any(b.all() for b in behind)


def test_a_quad_that_crosses_itself_becomes_its_hull():
    limit = 66.0
    # The first corner lies beyond the wall's outer side at x = -66.
    walls = ([(-70.0, -60.0), (-20.0, 0.0)], [(limit, -60.0), (20.0, 0.0)])
    rows = scenario_records([Scenario(start=(0, -51), light=(0, 36), walls=walls)], 5)
    points = _points(_quads(rows)[0])
    assert sorted(points.tolist()) == [[-70.0, -60.0], [-66.0, -60.0], [-66.0, 0.0], [-20.0, 0.0]]


def test_flat_quads_are_left_out():
    walls = ([(-66.0, -60.0), (-30.0, -60.0), (-20.0, 0.0)], [(66.0, -60.0), (20.0, 0.0)])
    rows = scenario_records([Scenario(start=(0, -51), light=(0, 36), walls=walls)], 5)
    assert rows.scenarios[0].quad_count == 2
