"""Settings: names, ranges and their file."""

import pytest

from ncrs.runs.settings import (
    ConfigError,
    TrainConfig,
    config_from_dict,
    load_config,
    save_config,
    setting_names,
)


def test_the_defaults_are_in_range():
    assert TrainConfig().check() == TrainConfig()


def test_round_trip_through_the_run_folder(tmp_path):
    config = config_from_dict(
        {
            "task": {"name": "carry_ball", "distance_score": "inverse_square"},
            "optimizer": {"sigma": 0.01},
            "engine": {"workers": 3},
            "seed": 7,
        }
    )
    save_config(config, tmp_path)
    assert load_config(tmp_path) == config


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"task": {"name": "chess"}}, "light_chase"),
        ({"task": {"grid_size": 2}}, "at least 3"),
        ({"task": {"distance_score": "linear"}}, "inverse_square"),
        ({"task": {"success_radius": -1.0}}, "success_radius"),
        ({"optimizer": {"name": "adam"}}, "sep_cma_es"),
        ({"optimizer": {"sigma": 0.0}}, "sigma must be positive"),
        ({"optimizer": {"population": 1}}, "population must be at least 2"),
        ({"optimizer": {"step_size": "fixed"}}, "csa"),
        ({"engine": {"name": "bullet"}}, "box2d"),
        ({"engine": {"workers": 0}}, "workers"),
        ({"seed": -1}, "seed must be an integer from 0 to 9223372036854775807, got -1"),
        ({"generations": 0}, "generations must be at least 1"),
        ({"mirroring": "up_down"}, "front_back"),
        ({"optimizer": {"sigma_decay": 0.9}}, "no schedule"),
        ({"placement_noise": 0.5}, "0 to 0.35"),
        ({"episodes": 7, "mirroring": "auto"}, "episodes must be even"),
        ({"success_bonus": -1.0}, "success_bonus must be at least 0"),
        ({"approach_bonus": float("inf")}, "finite"),
        ({"success_bonus": 1.0, "optimizer": {"name": "map_elites"}}, "learns from its archive"),
        ({"episodes": 0}, "episodes must be at least 1"),
        ({"checkpoint_seconds": float("nan")}, "checkpoint_seconds"),
        ({"generation": 5}, "Did you mean generations"),
        ({"optimizer": {"popsize": 5}}, "Known are: name, sigma, population"),
    ],
)
def test_bad_settings_name_what_is_allowed(values, message):
    with pytest.raises(ConfigError, match=message):
        config_from_dict(values)


def test_setting_names_are_dotted():
    names = setting_names()
    assert {"seed", "task.name", "optimizer.told_popsize", "engine.workers"} <= set(names)
    assert "task" not in names


def test_a_folder_without_a_run(tmp_path):
    with pytest.raises(ConfigError, match="holds no run"):
        load_config(tmp_path)
    (tmp_path / "config.json").write_text("{")
    with pytest.raises(ConfigError, match="not valid JSON"):
        load_config(tmp_path)
