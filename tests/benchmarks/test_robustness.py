"""The benchmark of robustness: one small point measured, and its table and figure."""

import json

from benchmarks.robustness import AXES, REPAIRER, ROBOTS, draw, measure, perturbations_of, table


def test_points_are_measured_once_and_shown(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("benchmarks.robustness.ROBOTS", (REPAIRER,))
    monkeypatch.setitem(AXES, "damage", ("modules lost", (0.0, 0.5)))
    file = tmp_path / "robustness.json"
    measure(file, ["damage"], 4, [0, 1])
    found = json.loads(file.read_text())
    assert found[f"{REPAIRER} damage 0.5"]["successes"] == [4, 4]
    assert found[f"{REPAIRER} damage 0.5"]["recovered"] == [1.0, 1.0]
    before = file.stat().st_mtime_ns
    measure(file, ["damage"], 4, [0, 1])
    assert file.stat().st_mtime_ns == before
    monkeypatch.setattr("benchmarks.robustness.AXES", {"damage": AXES["damage"]})
    capsys.readouterr()
    table(file)
    printed = capsys.readouterr().out
    assert f"| `{REPAIRER}` | 100% (68% to 100%) | 100% (68% to 100%) |" in printed
    assert "Modules that came back: 100.0%" in printed
    draw(file, tmp_path / "robustness.png")
    assert (tmp_path / "robustness.png").stat().st_size > 1000


def test_only_the_repairer_repairs():
    for robot in ROBOTS:
        settings = perturbations_of(robot, "damage", 0.3)
        assert (settings.damage_fraction, settings.damage_until) == (0.3, 50)
        assert (settings.repair_steps > 0) == (robot == REPAIRER)
