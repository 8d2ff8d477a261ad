"""Search spaces."""

import numpy as np
import pytest

import ncrs
from ncrs.automaton.carrier import BODY, GAINS, carrier_circuit
from ncrs.automaton.channels import nca_layout
from ncrs.evolution.space import (
    SPACES,
    AllWeights,
    GainSpace,
    SpaceError,
    WeightMap,
    check_space,
    register_search_space,
)
from ncrs.runs.engine_settings import ConfigError
from ncrs_envs.body import parse_body
from ncrs_envs.registry import ExtensionError

LAYOUT = nca_layout("light_chase")
SIZE = LAYOUT.num_parameters
SMALL = {
    "episodes": 2, "champion_episodes": 2, "champion_every": 1, "generations": 2,
    "optimizer": {"name": "cma_es", "population": 6, "sigma": 0.1, "parents": None},
    "checkpoint_seconds": 0, "symmetric": False, "progress": False,
}  # fmt: skip
CARRIER = {"task": {"name": "carry_ball"}, "space": "carrier", **SMALL}


def test_all_weights_are_the_points():
    points = np.random.default_rng(0).normal(size=(3, SIZE))
    space = AllWeights(LAYOUT, np.zeros(SIZE))
    assert space.dimension == SIZE
    assert space.genomes(points) is points


def test_weights_follow_their_coordinates():
    base = np.arange(SIZE, dtype=float)
    space = WeightMap(LAYOUT, base, [5, 9, 7], [0, 1, 0], [1.0, 2.0, -0.5])
    assert space.dimension == 2
    genomes = space.genomes(np.array([[10.0, 1.0], [0.0, 0.0]]))
    expected = base.copy()
    expected[[5, 9, 7]] += [10.0, 2.0, -5.0]
    np.testing.assert_array_equal(genomes, [expected, base])
    masked = WeightMap(LAYOUT, None, np.array([3, 1]), steps=0.1)
    np.testing.assert_allclose(masked.genomes(np.array([[1.0, 2.0]]))[0, :4], [0, 0.2, 0, 0.1])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([1, 1],), "weights must be different indices below 4572, got 1 different ones up to 1"),
        (([SIZE],), "below 4572"),
        (([-1],), "indices from 0"),
        (([0.5],), "indices from 0"),
        (([],), "indices from 0"),
        (([1, 2], [0]), "coordinates must be indices from 0, one for each weight"),
        (([1, 2], [0, 2]), "Each of the 3 coordinates must move at least one weight"),
        (([1, 2], None, [1.0, 0.0]), "steps must be finite and not 0"),
        (([1, 2], None, np.nan), "steps must be finite and not 0"),
    ],
)
def test_maps_that_do_not_fit_are_refused(arguments, message):
    with pytest.raises(SpaceError, match=message):
        WeightMap(LAYOUT, None, *arguments)


def test_gains_are_searched_in_units_of_their_start():
    seen = []

    def genome(gains):
        seen.append(dict(gains))
        return np.full(SIZE, gains["a"] + gains["b"])

    space = GainSpace(LAYOUT, {"a": 2.0, "b": -4.0}, genome)
    np.testing.assert_array_equal(space.start, [1, 1])
    found = space.genomes(np.array([[1.0, 1.0], [0.5, 2.0]]))
    np.testing.assert_array_equal(found[:, 0], [-2.0, -7.0])
    assert seen[-1] == {"a": 1.0, "b": -8.0}
    with pytest.raises(SpaceError, match=r"which is 0 for \['b'\]"):
        GainSpace(LAYOUT, {"a": 2.0, "b": 0.0}, genome)
    with pytest.raises(ncrs.GenomeError, match="must have shape"):
        GainSpace(LAYOUT, {"a": 2.0}, lambda gains: np.zeros(3))
    with pytest.raises(SpaceError, match="starts at a vector of finite numbers"):
        GainSpace(LAYOUT, {}, genome)


def test_the_carrier_carries_balls_before_any_search():
    genome = carrier_circuit(GAINS).genome() + ncrs.grow_to(BODY, "carry_ball")
    result = ncrs.evaluate(genome, "carry_ball", episodes=200, engine="batched")
    np.testing.assert_array_equal(result.bodies[0], parse_body(BODY))
    assert 0.15 < result.success.mean() < 0.35


def test_a_search_of_gains_resumes_exactly(tmp_path):
    ncrs.train(tmp_path / "whole", **CARRIER)
    ncrs.train(tmp_path / "halves", **{**CARRIER, "generations": 1})
    ncrs.train(tmp_path / "halves", resume=True, generations=2, progress=False)
    whole, halves = [
        ncrs.load_archive(tmp_path / name).archive.state()["elites"] for name in ("whole", "halves")
    ]
    assert whole.keys() == halves.keys()
    for name, values in whole.items():
        np.testing.assert_array_equal(values, halves[name], err_msg=name)
    metrics = (tmp_path / "whole" / "metrics.csv").read_text().splitlines()
    assert len(metrics) == 3


def test_a_space_of_ones_own_is_searched(tmp_path):
    def some(layout, start):
        return WeightMap(layout, start, np.arange(4000, 4100), steps=0.01)

    register_search_space("some_weights", some)
    register_search_space("some_weights", some)
    with pytest.raises(ExtensionError, match="already a search space 'some_weights'"):
        register_search_space("some_weights", lambda layout, start: None)
    settings = {**SMALL, "space": "some_weights", "start_from": "light_chase/best"}
    run = ncrs.train(tmp_path, **settings)
    moved = run.champion.genome != ncrs.load_champion("light_chase/best").genome
    assert moved[4000:4100].all()
    assert not np.delete(moved, np.arange(4000, 4100)).any()
    assert SPACES["some_weights"] is some


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"space": "nothing"}, "Unknown search space 'nothing'; choose one of weights, carrier"),
        ({"task": {"name": "obstacle"}}, "carrier is for carry_ball"),
        ({"start_from": "carry_ball/best"}, "has a start of its own"),
        ({"symmetric": True}, "space=carrier does not treat left and right alike"),
        ({"optimizer": {"name": "cma_me"}}, "does not start again from elites"),
        ({"optimizer": {"name": "map_elites"}}, "does not start again from elites"),
        (
            {"optimizer": {"name": "cma_es", "restart_from": "elite", "restart_sigma": 0.001}},
            "with restart_from=mean",
        ),
    ],
)
def test_spaces_that_do_not_fit_the_search_are_refused(tmp_path, settings, message):
    with pytest.raises(ConfigError, match=message):
        ncrs.train(tmp_path / "run", **{**CARRIER, **settings})
    assert not (tmp_path / "run").exists()
    assert check_space("carrier") == "carrier"
