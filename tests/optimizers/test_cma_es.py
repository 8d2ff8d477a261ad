"""CMA-ES: that it is CMA-ES, and that its state is complete."""

import warnings

import numpy as np
import pytest

from ncrs.checkpoint import read_state, write_state
from ncrs.optimizers import OptimizerError, make_optimizer
from ncrs.optimizers.cma_es import CMAES

VARIANTS = [
    (name, told, step_size)
    for name in ("cma_es", "sep_cma_es")
    for told in (True, False)
    for step_size in ("csa", "tpa")
]


def make(name="cma_es", told=True, step_size="csa", dimension=30, seed=3, **settings):
    settings = {"population": 20, "sigma": 0.1, **settings}
    return make_optimizer(
        name,
        dimension,
        np.random.SeedSequence(seed),
        told_popsize=told,
        step_size=step_size,
        **settings,
    )


def ellipsoid(population):
    weights = 10.0 ** np.linspace(0, 2, population.shape[1])
    return -((population - 0.3) ** 2 * weights).sum(axis=1)


def advance(optimizer, generations):
    for _ in range(generations):
        optimizer.tell(ellipsoid(optimizer.ask()))


@pytest.mark.parametrize(("name", "told", "step_size"), VARIANTS)
def test_it_maximises(name, told, step_size):
    optimizer = make(name, told, step_size)
    start = ellipsoid(optimizer.mean[None])[0]
    advance(optimizer, 150)
    assert ellipsoid(optimizer.mean[None])[0] > 0.01 * start  # fitness is negative


@pytest.mark.parametrize("pending", [False, True])
@pytest.mark.parametrize(("name", "told", "step_size"), VARIANTS)
def test_a_saved_state_goes_on_bit_for_bit(name, told, step_size, pending, tmp_path):
    optimizer = make(name, told, step_size)
    advance(optimizer, 25)
    if pending:
        optimizer.ask()
    write_state(tmp_path / "state.npz", optimizer.state())
    if pending:
        optimizer.tell(ellipsoid(optimizer._asked))
    resumed = make(name, told, step_size)
    resumed.load_state(read_state(tmp_path / "state.npz"))
    advance(optimizer, 30 - pending)
    advance(resumed, 30)
    np.testing.assert_array_equal(optimizer.ask(), resumed.ask())
    assert optimizer.metrics() == resumed.metrics()


def test_it_samples_as_plain_pycma_does():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import cma
    generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence(3)))
    plain = cma.CMAEvolutionStrategy(
        np.zeros(30),
        0.1,
        {
            "popsize": 20,
            "seed": float("nan"),
            "randn": lambda *shape: generator.standard_normal(shape),
            "AdaptSigma": cma.sigma_adaptation.CMAAdaptSigmaCSA,
            "verbose": -9,
        },
    )
    optimizer = make(linear_algebra="pycma")
    for _ in range(20):
        population = optimizer.ask()
        np.testing.assert_array_equal(population, np.array(plain.ask()))
        fitness = ellipsoid(population)
        optimizer.tell(fitness)
        plain.tell(list(population), list(-fitness))
    assert optimizer.sigma == plain.sigma


def test_the_untold_population_recombines_fewer_parents():
    size = {"dimension": 4572, "population": 112}
    # Telling pycma gives mu = lambda / 2; not telling gives lambda = 4 + 3 ln N = 29, mu = 14.
    assert make("sep_cma_es", True, **size)._es.sp.weights.mu == 56
    assert make("sep_cma_es", False, **size)._es.sp.weights.mu == 14


def test_one_seed_one_run_and_numpys_generator_is_left_alone():
    before = np.random.get_state()[1].copy()  # noqa: NPY002
    populations = [make(seed=seed).ask() for seed in (1, 1, 2)]
    np.testing.assert_array_equal(populations[0], populations[1])
    assert np.abs(populations[0] - populations[2]).max() > 0
    np.testing.assert_array_equal(np.random.get_state()[1], before)  # noqa: NPY002


def test_nan_ranks_worst():
    one, other = make(), make()
    fitness = ellipsoid(one.ask())
    other.ask()
    with_nan = fitness.copy()
    with_nan[4] = np.nan
    fitness[4] = -1e9
    one.tell(fitness)
    other.tell(with_nan)
    np.testing.assert_array_equal(one.mean, other.mean)


@pytest.mark.parametrize(
    ("fitness", "message"),
    [
        (np.zeros(19), r"20 fitness values.*\(19,\)"),
        (np.full(20, np.nan), "All 20"),
        (np.where(np.arange(20) == 3, np.inf, 0.0), r"infinite.*\[3\]"),
    ],
)
def test_bad_fitness_leaves_the_state_untouched(fitness, message):
    optimizer, twin = make(), make()
    population = optimizer.ask()
    twin.ask()
    with pytest.raises(OptimizerError, match=message):
        optimizer.tell(fitness)
    optimizer.tell(ellipsoid(population))
    twin.tell(ellipsoid(population))
    np.testing.assert_array_equal(optimizer.ask(), twin.ask())


def test_ask_and_tell_alternate():
    optimizer = make()
    with pytest.raises(OptimizerError, match="before ask"):
        optimizer.tell(np.zeros(20))
    optimizer.ask()
    with pytest.raises(OptimizerError, match="called twice"):
        optimizer.ask()


def test_a_foreign_state_is_refused_with_both_values():
    state = make().state()
    for other, message in [
        (make("sep_cma_es"), "diagonal"),
        (make(dimension=31), "dimension is 30, this optimizer's is 31"),
        (make(population=22), "'population': 20.*'population': 22"),
    ]:
        before = other.mean
        with pytest.raises(OptimizerError, match=message):
            other.load_state(state)
        np.testing.assert_array_equal(other.mean, before)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"sigma": 0.0}, "sigma"),
        ({"sigma": float("nan")}, "sigma"),
        ({"population": 1}, "population"),
        ({"step_size": "fixed"}, "csa"),
        ({"told_popsize": False, "population": 5, "dimension": 4572}, "14 parents"),
    ],
)
def test_bad_settings(settings, message):
    with pytest.raises(OptimizerError, match=message):
        CMAES(**{"dimension": 30, "seed": np.random.SeedSequence(0), **settings})


def test_unknown_optimizer():
    with pytest.raises(OptimizerError, match="sep_cma_es"):
        make_optimizer("adam", 10, np.random.SeedSequence(0))
