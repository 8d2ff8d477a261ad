"""Stored states: complete ones continue, all others are refused by the member's name."""

import copy

import numpy as np
import pytest

from ncrs.evolution.archive import Archive, MeasureSpace
from ncrs.evolution.optimizers import OPTIMIZERS, OptimizerError, make_optimizer
from ncrs_envs.body import body_measures

DIMENSION = 6
POPULATION = 12
VARIANTS = {
    "sep_cma_es": {"step_size": "csa", "parents": None},
    "sep_cma_es tpa": {"step_size": "tpa", "parents": None},
    "iso_cma_es": {"parents": 4},
    "cma_es": {},
    "cma_es pycma": {"linear_algebra": "pycma"},
    "cma_me": {"emitters": 2, "patience": 2, "diagonal": True},
    "cma_mae": {"emitters": 2, "patience": 2, "diagonal": True},
    "map_elites": {"initial_genomes": 12},
}


def make(variant):
    settings = OPTIMIZERS[variant.split()[0]].settings(population=POPULATION, **VARIANTS[variant])
    optimizer = make_optimizer(settings, DIMENSION, np.random.SeedSequence(1))
    archive = Archive(MeasureSpace(1, 2, 9), DIMENSION, 3)
    optimizer.attach(archive)
    return optimizer, archive


def advance(optimizer, archive, generations):
    bodies = np.full((POPULATION, 3, 3), 4, dtype=np.int8)
    bodies[:, 0, 0] = 2
    for _ in range(generations):
        genomes = optimizer.ask()
        fitness = -np.square(genomes).sum(axis=1)
        added = archive.add(genomes.astype(np.float32), fitness, body_measures(bodies), bodies)
        optimizer.tell(fitness, added)


QUICK = ("sep_cma_es", "sep_cma_es tpa", "iso_cma_es", "cma_es", "cma_mae", "map_elites")


@pytest.fixture(
    scope="module",
    params=[
        name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in VARIANTS
    ],
)
def saved(request):
    optimizer, archive = make(request.param)
    advance(optimizer, archive, 4)
    return request.param, optimizer.state()


def paths(state, prefix=()):
    """Every member of a state, but the identity, which has its own test, and the generator."""
    for name, value in state.items():
        if prefix == () and name in ("settings", "optimizer", "dimension", "generator"):
            continue
        if isinstance(value, dict):
            yield from paths(value, (*prefix, name))
        elif name == "emitters":
            yield from ((*prefix, name, 0, *path) for path in paths(value[0]))
        else:
            yield (*prefix, name)


def changed(state, path, change):
    result = copy.deepcopy(state)
    owner = result
    for name in path[:-1]:
        owner = owner[name]
    change(owner, path[-1])
    return result


def refused(variant, state):
    optimizer, _ = make(variant)
    with pytest.raises(OptimizerError) as error:
        optimizer.load_state(state)
    return str(error.value)


def test_a_whole_state_continues(saved):
    variant, state = saved
    optimizer, _ = make(variant)
    optimizer.load_state(copy.deepcopy(state))
    np.testing.assert_equal(optimizer.state(), state)


def test_no_member_may_be_missing(saved):
    variant, state = saved
    for path in paths(state):
        message = refused(variant, changed(state, path, lambda owner, name: owner.pop(name)))
        assert path[-1] in message, path


def test_no_member_may_be_foreign_or_renamed(saved):
    variant, state = saved
    for path in paths(state):

        def rename(owner, name):
            owner[f"{name}_renamed"] = owner.pop(name)

        refused(variant, changed(state, path, rename))

        def add(owner, name):
            owner[f"{name}_more"] = owner[name]

        assert f"{path[-1]}_more" in refused(variant, changed(state, path, add)), path


def test_arrays_must_have_their_shape_and_be_finite(saved):
    variant, state = saved
    checked = 0
    for path in paths(state):
        owner = state
        for name in path:
            owner = owner[name]
        if not (isinstance(owner, np.ndarray) and owner.ndim and owner.dtype.kind == "f"):
            continue
        checked += 1

        def spoil(owner, name):
            owner[name] = owner[name].copy()
            owner[name].flat[0] = np.nan

        assert "finite" in refused(variant, changed(state, path, spoil)), path

        def shorten(owner, name):
            owner[name] = owner[name][:-1]

        assert "shape" in refused(variant, changed(state, path, shorten)), path
    assert checked > 0 or variant == "map_elites"


def test_the_generators_state_is_checked(saved):
    variant, state = saved
    for spoiled in ({}, {**state["generator"], "bit_generator": "MT19937"}, None):
        refused(variant, {**state, "generator": spoiled})


def test_changing_the_proposed_population_changes_nothing():
    results = []
    for spoil in (False, True):
        optimizer, _ = make("sep_cma_es")
        genomes = optimizer.ask()
        fitness = -np.square(genomes).sum(axis=1)
        if spoil:
            genomes[:] = 7.0
        optimizer.tell(fitness)
        results.append(optimizer.mean)
    np.testing.assert_array_equal(*results)
