"""``ncrs evaluate`` and ``ncrs film`` under damage."""

import json

import pytest

from ncrs.cli import main


def test_a_test_under_damage_has_a_file_of_its_own(tmp_path, capsys):
    damage = ["--damage-fraction", "0.3", "--damage-until", "50", "--repair-steps", "4"]
    command = ["evaluate", "light_chase/best", "--episodes", "6", "--output", str(tmp_path)]
    main([*command, "--engine", "batched", *damage])
    assert "regrown" in capsys.readouterr().out
    (file,) = tmp_path.iterdir()
    assert file.name == "evaluation_perturbed.json"
    values = json.loads(file.read_text())
    assert values["perturbations"]["damage_until"] == 50
    assert 0.0 <= values["recovered"] <= 1.0
    assert values["success"]["episodes"] == 6


def test_settings_out_of_range_end_with_one_sentence(tmp_path, capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["evaluate", "light_chase/best", "--damage-fraction", "3", "--output", str(tmp_path)])
    assert capsys.readouterr().err == "ncrs: damage_fraction must lie in 0 to 1, got 3.0.\n"
