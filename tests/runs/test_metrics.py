"""The table of a run's curves."""

import warnings

import numpy as np
import pytest

from ncrs.runs.engine_settings import ConfigError
from ncrs.runs.metrics import METRICS_FILE, MetricsFile, MetricsWarning, read_metrics


def test_rows_come_back_and_late_columns_are_nan_before(tmp_path):
    table = MetricsFile(tmp_path, 0)
    table.add(0, {"fitness/best": 0.1})
    table.add(1, {"fitness/best": 0.2, "champion/fitness": 0.15})
    table.add(2, {"champion/fitness": 1 / 3})
    columns = read_metrics(tmp_path)
    np.testing.assert_array_equal(columns["generation"], [0, 1, 2])
    np.testing.assert_array_equal(columns["fitness/best"], [0.1, 0.2, np.nan])
    np.testing.assert_array_equal(columns["champion/fitness"], [np.nan, 0.15, 1 / 3])


def test_resuming_drops_what_comes_again_and_half_rows(tmp_path):
    table = MetricsFile(tmp_path, 0)
    for generation in range(5):
        table.add(generation, {"a": generation, "b": 1.0})
    with (tmp_path / METRICS_FILE).open("a") as stream:
        stream.write("5,5.")  # killed while writing
    resumed = MetricsFile(tmp_path, 3)
    resumed.add(3, {"a": 30.0, "b": 2.0})
    columns = read_metrics(tmp_path)
    np.testing.assert_array_equal(columns["generation"], [0, 1, 2, 3])
    np.testing.assert_array_equal(columns["a"], [0, 1, 2, 30])
    MetricsFile(tmp_path, 0)
    with pytest.raises(ConfigError, match="holds no generation"):
        read_metrics(tmp_path)


def test_missing_and_foreign_tables(tmp_path):
    with pytest.raises(ConfigError, match="holds no generation"):
        read_metrics(tmp_path)
    (tmp_path / METRICS_FILE).write_text("generation,a\n0,much\n")
    with pytest.raises(ConfigError, match="not a table of numbers"):
        read_metrics(tmp_path)


def whole(folder, generations=5):
    table = MetricsFile(folder, 0)
    for index in range(generations):
        table.add(index, {"fitness/best": index / 8})


@pytest.mark.parametrize("place", ["row", "names"])
def test_a_foreign_byte_spoils_its_row_alone_and_is_said(tmp_path, place):
    whole(tmp_path)
    path = tmp_path / "metrics.csv"
    lines = path.read_bytes().splitlines(keepends=True)
    spoiled = 3 if place == "row" else 0
    lines[spoiled] = b"\xff" + lines[spoiled][1:]
    path.write_bytes(b"".join(lines))
    lost = 1 if place == "row" else 5
    with pytest.warns(
        MetricsWarning, match=f"lacks {lost} of the 5 generations.*run itself is whole"
    ):
        table = MetricsFile(tmp_path, 5)
    table.add(5, {"fitness/best": 0.625})
    expected = [0, 1, 3, 4, 5] if place == "row" else [5]
    assert read_metrics(tmp_path)["generation"].tolist() == expected


def test_missing_rows_are_said_and_whole_tables_are_quiet(tmp_path):
    whole(tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        MetricsFile(tmp_path, 4)
    path = tmp_path / "metrics.csv"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:2] + lines[3:]))
    with pytest.warns(MetricsWarning, match="lacks 1 of the 4"):
        MetricsFile(tmp_path, 4)
