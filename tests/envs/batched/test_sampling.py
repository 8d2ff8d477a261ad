"""Scenarios drawn for many episodes at once are the ones that are drawn one by one."""

import numpy as np
import pytest

from ncrs_envs.batched.env_streams import EnvStreams
from ncrs_envs.batched.records import scenario_records
from ncrs_envs.batched.scenario_table import ScenarioTable
from ncrs_envs.scenario import sample_scenario
from ncrs_envs.tasks import get_task


def streams_and_generators(count):
    streams = EnvStreams(count)
    streams.seed({i: 1000 + i for i in range(count)})
    return streams, [np.random.default_rng(1000 + i) for i in range(count)]


@pytest.mark.parametrize("task", ["light_chase", "obstacle", "carry_ball"])
@pytest.mark.parametrize("grid_size", [3, 5, 9, 15])
def test_equal_bit_by_bit(task, grid_size):
    """Twice in a row, so that streams are also left alike; some starts are drawn again."""
    count = 200
    table = ScenarioTable(get_task(task), count, grid_size)
    assert table[0] is None
    fast, simple = streams_and_generators(count)
    regions = [[None, 0, 1, 2, 3][i % 5] for i in range(count)]
    for _ in range(2):
        table.draw(list(range(count)), fast, regions)
        expected = [
            sample_scenario(task, generator, region, grid_size)
            for generator, region in zip(simple, regions, strict=True)
        ]
        assert [table[i] for i in range(count)] == expected
        assert [table.start(i) for i in range(count)] == [s.start for s in expected]
        rows = scenario_records(expected, grid_size)
        for name in rows.scenarios.dtype.names:
            found, wanted = table.records.scenarios[name], rows.scenarios[name]
            assert np.array_equal(found, wanted, equal_nan=True)
        for i in range(count):
            for j in range(rows.scenarios[i].quad_count):
                found, wanted = table.records.quads[i, j], rows.quads[i, j]
                for name in ("low_x", "high_x", "low_y", "high_y", "corner_count"):
                    assert found[name] == wanted[name]
                # A triangle leaves the place of a fourth corner as it was.
                corners = wanted.corner_count
                assert np.array_equal(found.corners[:corners], wanted.corners[:corners])
                assert np.array_equal(found.edges[:corners], wanted.edges[:corners])
