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
    LinearMap,
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


def test_directions_are_added_point_by_point():
    matrix = np.zeros((SIZE, 2))
    matrix[7], matrix[9, 1] = [1.0, -2.0], 0.5
    base = np.arange(SIZE, dtype=float)
    space = LinearMap(LAYOUT, base, matrix, np.array([0.0, 1.0]))
    np.testing.assert_array_equal(space.start, [0, 1])
    expected = base.copy()
    expected[[7, 9]] += [3.0 - 2.0 * 4.0, 0.5 * 4.0]
    found = space.genomes(np.array([[3.0, 4.0], [0.0, 0.0]]))
    np.testing.assert_array_equal(found, [expected, base])
    np.testing.assert_array_equal(space.genomes(np.array([[3.0, 4.0]])), found[:1])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.zeros(3), np.zeros((SIZE, 2))), r"base must have shape \(4572,\)"),
        ((np.zeros(SIZE), np.zeros((3, 2))), r"matrix \(4572, D\), got .* and \(3, 2\)"),
        ((np.zeros(SIZE), np.zeros(SIZE)), r"matrix \(4572, D\)"),
        ((np.zeros(SIZE), np.full((SIZE, 2), np.nan)), "must be finite"),
        ((np.zeros(SIZE), np.zeros((SIZE, 2)), np.zeros(3)), r"start must have shape \(2,\)"),
        ((np.zeros(SIZE), np.zeros((SIZE, 0))), "starts at a vector of finite numbers"),
    ],
)
def test_directions_that_do_not_fit_are_refused(arguments, message):
    with pytest.raises(SpaceError, match=message):
        LinearMap(LAYOUT, *arguments)


def test_relays_start_with_their_body_a_grown_one_or_where_a_search_ended(tmp_path):
    layout = nca_layout("carry_ball")
    relays = SPACES["relays"]
    point = np.random.default_rng(0).normal(scale=0.1, size=(1, relays(layout, None).dimension))
    genome = relays(layout, None).genomes(point)[0]
    ended = relays(layout, genome.astype(np.float32).astype(float))
    np.testing.assert_allclose(ended.start, point[0], atol=1e-3)
    np.testing.assert_allclose(ended.genomes(ended.start[None])[0], genome, atol=1e-3)

    body = ["L.L", "WWW", "..."]
    grown = ncrs.grow_to(body, "obstacle").astype(float)
    of_ones_own = relays(nca_layout("obstacle"), grown)
    assert not of_ones_own.start.any()
    found = of_ones_own.genomes(of_ones_own.start[None])
    result = ncrs.evaluate(found, "obstacle", episodes=1, grid_size=3, engine="batched")
    np.testing.assert_array_equal(result.bodies[0], parse_body(body))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"task": {"name": "obstacle"}}, "no body for obstacle: grow one"),
        ({"start_from": "carry_ball/cma_es"}, "starts from a body that ncrs.grow_to has grown"),
        ({"symmetric": True}, "space=relays does not treat left and right alike"),
    ],
)
def test_relays_that_do_not_fit_are_refused(tmp_path, settings, message):
    with pytest.raises(ConfigError, match=message):
        ncrs.train(tmp_path / "run", **{**CARRIER, "space": "relays", **settings})
    assert not (tmp_path / "run").exists()


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
