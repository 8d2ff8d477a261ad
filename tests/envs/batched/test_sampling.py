"""Scenarios drawn for many runs at once are the ones that are drawn one by one."""

import numpy as np
import pytest

from ncrs_envs.batched import layout
from ncrs_envs.batched.records import scenario_arrays
from ncrs_envs.batched.scenario_table import ScenarioTable
from ncrs_envs.scenario import sample_scenario
from ncrs_envs.tasks import get_task


def _generators(count, seed=0):
    return [np.random.default_rng([seed, i]) for i in range(count)]


@pytest.mark.parametrize("task", ["light_chase", "obstacle", "carry_ball"])
@pytest.mark.parametrize("grid_size", [3, 5, 9, 15])
def test_equal_bit_by_bit(task, grid_size):
    """Twice in a row, so that generators are also left alike; some starts are drawn again."""
    count = 200
    table = ScenarioTable(get_task(task), count, grid_size)
    assert table[0] is None
    fast, simple = _generators(count), _generators(count)
    regions = [[None, 0, 1, 2, 3][i % 5] for i in range(count)]
    for _ in range(2):
        table.draw(list(range(count)), fast, regions)
        expected = [
            sample_scenario(task, generator, region, grid_size)
            for generator, region in zip(simple, regions, strict=True)
        ]
        assert [table[i] for i in range(count)] == expected
        assert [table.start(i) for i in range(count)] == [s.start for s in expected]
        rows, header = scenario_arrays(expected, grid_size), layout.SCENARIO_HEADER
        assert np.array_equal(table.records[:, :header], rows[:, :header], equal_nan=True)
        for record, row in zip(table.records, rows, strict=True):
            for i in range(int(row[layout.SCENARIO_QUADS])):
                quad = layout.SCENARIO_HEADER + layout.QUAD_SIZE * i
                corners = int(row[quad + layout.QUAD_CORNERS])
                # A triangle leaves the places of a fourth corner as they were.
                for first, size in (
                    (0, layout.QUAD_POINTS),
                    (layout.QUAD_POINTS, 2 * corners),
                    (layout.QUAD_EDGES, 3 * corners),
                ):
                    part = slice(quad + first, quad + first + size)
                    assert np.array_equal(record[part], row[part])
