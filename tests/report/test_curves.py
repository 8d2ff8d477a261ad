"""Curves from a run's table."""

import numpy as np
import pytest

from ncrs.report.curves import Curve, load_curves
from ncrs.runs.engine_settings import ConfigError


def test_each_metric_is_a_curve_of_the_generations_that_have_it(tmp_path):
    points = {generation: 0.1 * generation**0.5 for generation in range(12)}
    rows = ["generation,fitness/best,champion/fitness"]
    rows += [f"{g},{v},{2 * v if g % 4 == 3 else ''}" for g, v in points.items()]
    (tmp_path / "metrics.csv").write_text("\n".join(rows) + "\n")
    curves = load_curves(tmp_path)
    assert set(curves) == {"fitness/best", "champion/fitness"}
    assert curves["fitness/best"].generations.tolist() == list(range(12))
    assert curves["fitness/best"].values.tolist() == list(points.values())
    assert curves["champion/fitness"].generations.tolist() == [3, 7, 11]
    assert curves["champion/fitness"].values.tolist() == [2 * points[g] for g in (3, 7, 11)]


def test_generation_done_again_after_resuming_counts_once(tmp_path):
    text = "generation,fitness/best\n0,0.1\n1,0.2\n1,0.3\n2,nan\n"
    (tmp_path / "metrics.csv").write_text(text)
    curve = load_curves(tmp_path)["fitness/best"]
    assert curve.generations.tolist() == [0, 1]
    assert curve.values.tolist() == [0.1, 0.3]


def test_no_logs_are_no_curves(tmp_path):
    assert load_curves(tmp_path) == {}


def test_damaged_table_is_refused(tmp_path):
    (tmp_path / "metrics.csv").write_text("generation,fitness/best\n0,0.1\n1,zero\n")
    with pytest.raises(ConfigError, match="not a table of numbers"):
        load_curves(tmp_path)


def test_thinning_keeps_the_ends():
    curve = Curve(np.arange(1000), np.linspace(0.0, 1.0, 1000))
    thin = curve.thinned(10)
    assert len(thin.values) == len(thin.generations) == 10
    assert thin.generations[[0, -1]].tolist() == [0, 999]
    np.testing.assert_array_equal(thin.values, curve.values[thin.generations])
    assert curve.thinned(1000) is curve
