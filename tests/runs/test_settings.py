"""Settings: names, ranges and their file."""

import copy
import json
from dataclasses import asdict

import pytest

from ncrs.evolution.optimizers import OPTIMIZERS, SepCMAESSettings
from ncrs.runs.engine_settings import ConfigError, EngineSettings
from ncrs.runs.settings import (
    TrainConfig,
    check_same_settings,
    config_from_dict,
    lasting_settings,
    load_config,
    save_config,
)


def test_the_defaults_are_in_range_and_round_trip():
    config = TrainConfig()
    assert config_from_dict(asdict(config)) == config


def test_round_trip_through_the_run_folder(tmp_path):
    config = config_from_dict(
        {
            "task": {"name": "carry_ball", "distance_score": "inverse_square"},
            "optimizer": {"name": "cma_me", "sigma": 0.02, "emitters": 3},
            "engine": {"workers": 3},
            "perturbations": {"damage_fraction": 0.3, "damage_until": 50},
            "seed": 7,
        }
    )
    save_config(config, tmp_path)
    assert load_config(tmp_path) == config
    assert (config.optimizer.name, config.optimizer.emitters) == ("cma_me", 3)


@pytest.mark.parametrize("name", OPTIMIZERS)
def test_the_settings_of_every_optimizer_round_trip(name, tmp_path):
    config = TrainConfig(optimizer=OPTIMIZERS[name].settings(population=50))
    assert config.optimizer.name == name
    save_config(config, tmp_path)
    assert load_config(tmp_path) == config


def test_without_a_name_the_optimizer_is_the_default():
    config = config_from_dict({"optimizer": {"sigma": 0.01}})
    assert config.optimizer == SepCMAESSettings(sigma=0.01)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"task": {"name": "chess"}}, "light_chase"),
        ({"task": {"grid_size": 2}}, "at least 3"),
        ({"perturbations": {"share": 1.5}}, "share must lie in 0 to 1"),
        ({"perturbations": {"damage": 0.3}}, "perturbations.damage_step"),
        ({"recovery_bonus": -1.0}, "recovery_bonus must be at least 0"),
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
        ({"optimizer": {"step_size": "csa", "sigma_decay": 0.9}}, "no schedule"),
        ({"placement_noise": 0.5}, "0 to 0.35"),
        ({"episodes": 7, "mirroring": "auto"}, "episodes must be even"),
        ({"success_bonus": -1.0}, "success_bonus must be at least 0"),
        ({"approach_bonus": float("inf")}, "finite"),
        ({"success_bonus": 1.0, "optimizer": {"name": "map_elites"}}, "learns from its archive"),
        ({"objective": "speed"}, "objective must be one of"),
        (
            {"objective": "soft_success", "optimizer": {"name": "map_elites"}},
            "learns from its archive",
        ),
        ({"curriculum": "harder"}, "curriculum must be one of"),
        ({"curriculum": "reverse", "task": {"name": "obstacle"}}, "does not suit obstacle"),
        ({"curriculum_generations": 0}, "curriculum_generations must be at least 1"),
        ({"episodes": 0}, "episodes must be at least 1"),
        ({"checkpoint_seconds": float("nan")}, "checkpoint_seconds"),
        ({"generation": 5}, "Did you mean generations"),
        ({"optimizer": {"popsize": 5}}, "Unknown setting 'optimizer.popsize'"),
        ({"optimizer": {"sgima": 5}}, "Did you mean optimizer.sigma"),
        ({"optimizer": {"emitters": 5}}, "sep_cma_es has no setting .*; cma_me and cma_mae have"),
        ({"optimizer": {"sigma": "0.1"}}, "sigma must be a number, got '0.1'"),
        ({"population": 5}, "Did you mean optimizer.population"),
        ({"seed": 1.5}, "seed must be an integer, got 1.5"),
        ({"symmetric": 1}, "symmetric must be true or false, got 1"),
        ({"start_from": 3}, "start_from must be a string, got 3"),
    ],
)
def test_bad_settings_name_what_is_allowed(values, message):
    with pytest.raises(ConfigError, match=message):
        config_from_dict(values)


def test_settings_that_are_made_in_python_are_checked_too():
    with pytest.raises(ConfigError, match="episodes must be even"):
        TrainConfig(episodes=7)
    with pytest.raises(ConfigError, match="optimizer must be one of the OptimizerSettings, got"):
        TrainConfig(optimizer="cma_es")


def test_a_folder_without_a_run(tmp_path):
    with pytest.raises(ConfigError, match="holds no run"):
        load_config(tmp_path)
    (tmp_path / "config.json").write_text("{")
    with pytest.raises(ConfigError, match="not valid JSON"):
        load_config(tmp_path)


MUTATIONS = [
    None, True, -1, 0, 1.5, 10**400, float("nan"), float("inf"), "", "text", [], {}, [1], {"a": 1},
]  # fmt: skip


def _places(values, prefix=()):
    yield prefix
    if isinstance(values, dict):
        for name, value in values.items():
            yield from _places(value, (*prefix, name))


@pytest.mark.parametrize("optimizer", ["sep_cma_es", "cma_mae"])
def test_any_mutation_of_a_stored_setting_loads_or_is_refused_clearly(optimizer, tmp_path):
    whole = asdict(TrainConfig(optimizer=OPTIMIZERS[optimizer].settings()))
    del whole["resume"]
    refused = 0
    for place in _places(whole):
        for mutation in MUTATIONS:
            values = copy.deepcopy({"": whole})
            owner = values
            for name in ("", *place)[:-1]:
                owner = owner[name]
            owner[("", *place)[-1]] = mutation
            (tmp_path / "config.json").write_text(json.dumps(values[""]))
            try:
                assert isinstance(load_config(tmp_path), TrainConfig)
            except ConfigError as error:
                refused += str(error).startswith(f"{tmp_path / 'config.json'} does not hold")
    assert refused > 200


@pytest.mark.parametrize("content", [b"\xff\xfe", b"{", b"[" * 100_000, b""])
def test_a_file_that_is_no_json_is_named(content, tmp_path):
    (tmp_path / "config.json").write_bytes(content)
    with pytest.raises(ConfigError, match="is not valid JSON"):
        load_config(tmp_path)


def test_an_engine_is_given_the_settings_of_its_own_that_are_not_the_default():
    assert EngineSettings("dask", workers=3).own() == {}
    given = EngineSettings("dask", scheduler="tcp://host:8786", audit=0.0, devices=None)
    assert given.own() == {"scheduler": "tcp://host:8786", "audit": 0.0}


def test_where_a_cluster_is_may_change_on_resuming_but_not_the_engine_of_its_workers():
    here, there = (
        lasting_settings(TrainConfig(engine=EngineSettings("dask", scheduler=name)))
        for name in ("tcp://here:1", "tcp://there:1")
    )
    check_same_settings(here, there)
    other = lasting_settings(TrainConfig(engine=EngineSettings("dask", on_workers="box2d")))
    with pytest.raises(ConfigError, match=r"engine\.on_workers is 'auto', 'box2d' was given"):
        check_same_settings(here, other)
