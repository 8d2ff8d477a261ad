"""The records of settings: their checks, and the optimizers that they make."""

import numpy as np
import pytest

from ncrs.evolution.optimizers import OPTIMIZERS, CMAESSettings, OptimizerError, make_optimizer


@pytest.mark.parametrize("name", OPTIMIZERS)
def test_an_optimizer_takes_its_record_whole(name):
    settings = OPTIMIZERS[name].settings(population=30)
    optimizer = make_optimizer(settings, 12, np.random.SeedSequence(0))
    assert optimizer.settings is settings
    assert optimizer.name == settings.name == name
    assert optimizer.state()["settings"]["population"] == 30


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"sigma": 0.0}, "sigma"),
        ({"sigma": float("nan")}, "sigma"),
        ({"sigma": "0.1"}, "sigma must be a number, got '0.1'"),
        ({"population": 1}, "population"),
        ({"population": 20.5}, "population must be an integer, got 20.5"),
        ({"name": "sep_cma_es"}, "name must be 'cma_es'.*optimizer=NAME"),
        ({"parents": 0}, "parents must be at least 1"),
        ({"step_size": "fixed"}, "csa"),
        ({"restart_from": "worst"}, "best.*elite.*mean"),
        ({"restart_sigma": -1.0}, "restart_sigma must be positive"),
        ({"sigma": 0.1, "restart_sigma": 0.1}, "smaller than sigma"),
        ({"linear_algebra": "numpy"}, "pycma.*torch"),
        ({"precision": "float16"}, "float32.*float64.*float16"),
        ({"linear_algebra": "pycma", "precision": "float64"}, "leave out precision"),
        ({"parents": 14, "population": 5}, "14 parents"),
    ],
)
def test_bad_settings(settings, message):
    with pytest.raises(OptimizerError, match=message):
        CMAESSettings(**settings)


def test_settings_hold_plain_numbers():
    settings = CMAESSettings(sigma=1, population=np.int64(20))
    assert type(settings.sigma) is float
    assert type(settings.population) is int


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"sigma_decay": 0.9}, "step_size=csa has no schedule: leave out sigma_decay"),
        ({"step_size": "decay", "sigma_decay": 1.1}, "sigma_decay must lie in"),
        ({"step_size": "decay", "sigma_min": 0.2}, "at most sigma"),
        ({"step_size": "decay", "sigma_min": 0.05, "restart_sigma": 0.05}, "must exceed"),
    ],
)
def test_an_invalid_schedule_is_refused(settings, message):
    with pytest.raises(OptimizerError, match=message):
        CMAESSettings(**{"sigma": 0.1, **settings})


@pytest.mark.parametrize(
    ("name", "settings", "message"),
    [
        ("cma_me", {"emitters": 0}, "emitters must be at least 1"),
        ("cma_me", {"patience": 0}, "patience must be at least 1"),
        ("cma_me", {"ranking": "novelty"}, "improvement"),
        ("cma_me", {"sigma": -1.0}, "sigma"),
        ("cma_mae", {"linear_algebra": "pycma"}, "no matrices: leave out linear_algebra"),
        (
            "cma_me",
            {"diagonal": True, "precision": "float64", "device": "cuda"},
            "no matrices: leave out precision",
        ),
        ("cma_mae", {"learning_rate": 1.5}, "learning_rate must be from 0 to 1"),
        ("cma_mae", {"threshold_min": float("nan")}, "threshold_min"),
        ("map_elites", {"population": 0}, "population"),
        ("map_elites", {"initial_genomes": -1}, "initial_genomes"),
        ("map_elites", {"sparse_fraction": 2.0}, "sparse_fraction"),
        ("map_elites", {"line_sigma": 0.0}, "line_sigma"),
        ("map_elites", {"sparse_sigma_min": 2.0}, "sparse_sigma_max"),
    ],
)
def test_bad_settings_of_the_others(name, settings, message):
    with pytest.raises(OptimizerError, match=message):
        OPTIMIZERS[name].settings(**settings)
