"""The Cholesky sampler: pycma's arithmetic without its eigenvectors."""

import warnings

import numpy as np
import pytest

from ncrs.evolution.optimizers import CMAESSettings, OptimizerError
from ncrs.evolution.optimizers.cholesky_sampler import CholeskySampler
from ncrs.evolution.optimizers.cma_es import CMAES
from ncrs.runs.checkpoint import read_state, write_state

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import cma
    from cma.sampler import GaussFullSampler

N = 12
TOLERANCE = {"float32": 2e-5, "float64": 1e-12}


def make(precision="float64", dimension=N, seed=0):
    generator = np.random.default_rng(seed)
    return CholeskySampler(
        dimension, lambda *shape: generator.standard_normal(shape), precision=precision
    )


def learn(*samplers, times=5, seed=1):
    """The same updates for all, with negative weights among the weights."""
    generator = np.random.default_rng(seed)
    scales = 3.0 ** np.arange(N)[::-1] ** 0.5
    for _ in range(times):
        steps = generator.standard_normal((9, N)) * scales
        weights = [0.02, 0.1, 0.05, 0.02, 0.0, 0.0, -0.002, -0.003, -0.004]
        for sampler in samplers:
            sampler.update(list(steps.copy()), list(weights))
            sampler.update_now()


@pytest.mark.parametrize("precision", TOLERANCE)
def test_it_learns_what_pycmas_sampler_learns(precision):
    ours, theirs = make(precision), GaussFullSampler(np.ones(N))
    theirs.C, theirs.D, theirs.B = np.eye(N), np.ones(N), np.eye(N)  # it starts a little off
    learn(ours, theirs)
    scale, atol = theirs.C.max(), TOLERANCE[precision]
    np.testing.assert_allclose(ours.covariance() / scale, theirs.C / scale, atol=atol)
    np.testing.assert_allclose(ours.variances / scale, theirs.variances / scale, atol=atol)
    x = np.random.default_rng(2).standard_normal(N)
    assert ours.norm(x) == pytest.approx(theirs.norm(x), rel=50 * atol)
    np.testing.assert_allclose(ours.inverse() @ theirs.C, np.eye(N), atol=100 * atol)


@pytest.mark.parametrize("precision", TOLERANCE)
def test_the_factor_is_a_root_of_the_covariance(precision):
    sampler = make(precision)
    learn(sampler)
    root = np.stack([sampler.transform(e) for e in np.eye(N)], axis=1)
    scale = sampler.variances.max()
    atol = TOLERANCE[precision]
    np.testing.assert_allclose(root @ root.T / scale, sampler.covariance() / scale, atol=atol)
    x = np.random.default_rng(2).standard_normal(N)
    np.testing.assert_allclose(sampler.transform_inverse(sampler.transform(x)), x, atol=10 * atol)
    z = np.random.default_rng(0).standard_normal((4, N))
    samples = sampler.sample(4)
    np.testing.assert_allclose(samples, z @ root.T, atol=atol * root.max() * 10)


def test_blocks_cover_the_whole_triangle(monkeypatch):
    whole, blocked = make(), make()
    learn(whole)
    monkeypatch.setattr("ncrs.evolution.optimizers.cholesky_sampler._BLOCK", 5)
    learn(blocked)
    np.testing.assert_allclose(blocked.covariance(), whole.covariance(), rtol=1e-12)
    np.testing.assert_allclose(blocked.sample(3), whole.sample(3), rtol=1e-9)


def test_the_factor_is_renewed_at_the_lazy_interval():
    sampler = make()
    sampler.lazy_update_gap = 2.5
    renewed = []
    for _ in range(7):
        before = sampler.transform(np.ones(N))
        learn(sampler, times=1)
        renewed.append(bool((sampler.transform(np.ones(N)) != before).any()))
    assert renewed == [False, False, True, False, False, True, False]


def test_pycmas_rates_and_weights_are_kept():
    optimizer = CMAES(40, np.random.SeedSequence(0), CMAESSettings(sigma=0.1, population=16))
    plain = cma.CMAEvolutionStrategy(np.zeros(40), 0.1, {"popsize": 16, "verbose": -9})
    assert list(optimizer._es.sp.weights) == list(plain.sp.weights)
    assert optimizer._es.sm.parameters() == plain.sm.parameters()
    assert optimizer._es.sm.lazy_update_gap == plain.sm.lazy_update_gap


def test_the_condition_number_is_estimated_from_below():
    sampler = make()
    learn(sampler, times=1)
    for _ in range(40):  # of one covariance: the estimate converges
        sampler.update_now(-1)
    assert sampler.condition_number == pytest.approx(np.linalg.cond(sampler.covariance()), rel=0.01)
    assert make().condition_number == 1.0


@pytest.mark.parametrize("precision", TOLERANCE)
def test_a_covariance_that_is_not_positive_definite_is_repaired_and_counted(precision):
    sampler = make(precision)
    direction = np.ones(N) / np.sqrt(N)
    sampler._c.add_(sampler._tensor(np.outer(direction, direction)), alpha=-1.0 - 1e-6)
    sampler.count_tell += 1
    assert np.linalg.eigvalsh(sampler.covariance())[0] < 0
    samples = sampler.sample(200)
    assert sampler.repairs > 0
    assert np.linalg.eigvalsh(sampler.covariance())[0] > 0
    assert np.isfinite(samples).all()
    assert np.abs(samples @ direction).max() < 0.1  # little was added
    others = samples - np.outer(samples @ direction, direction)
    assert np.mean(others**2) == pytest.approx((N - 1) / N, rel=0.1)


@pytest.mark.parametrize(
    ("value", "message"), [(np.nan, "mean variance is nan"), (-5.0, "mean variance is -")]
)
def test_a_covariance_beyond_repair_is_an_error(value, message):
    sampler = make()
    sampler._c.diagonal().fill_(value)
    sampler.count_tell += 1
    with pytest.raises(OptimizerError, match=message):
        sampler.sample(1)


def test_a_nan_off_the_diagonal_is_an_error():
    sampler = make()
    sampler._c[5, 2] = np.nan
    sampler.count_tell += 1
    before = sampler.covariance()
    for _ in range(2):  # and trying again finds it as it was
        with pytest.raises(OptimizerError, match="could not be made positive definite"):
            sampler.sample(1)
        np.testing.assert_array_equal(sampler.covariance(), before)
        assert sampler.repairs == 0


@pytest.mark.parametrize("precision", TOLERANCE)
def test_a_saved_state_goes_on_bit_for_bit(precision, tmp_path):
    sampler = make(precision)
    sampler.lazy_update_gap = 3.5
    learn(sampler, times=6)  # the factor is older than the covariance
    sampler.repairs = 2
    write_state(tmp_path / "state.npz", sampler.state())
    resumed = make(precision, seed=7)
    resumed.load_state(read_state(tmp_path / "state.npz"))
    for each in (sampler, resumed):
        generator = np.random.default_rng(5)
        each.randn = lambda *shape, generator=generator: generator.standard_normal(shape)
        learn(each, times=9)
    np.testing.assert_array_equal(sampler.sample(5), resumed.sample(5))
    np.testing.assert_array_equal(sampler.covariance(), resumed.covariance())
    assert sampler.condition_number == resumed.condition_number
    assert resumed.repairs == 2


def test_a_state_is_a_snapshot():
    sampler = make()
    learn(sampler)
    state = sampler.state()
    before = {key: np.copy(value) for key, value in state.items()}
    learn(sampler)
    for key, value in before.items():
        np.testing.assert_array_equal(state[key], value)


def test_reset_returns_to_the_identity():
    sampler = make()
    learn(sampler)
    sampler.reset()
    np.testing.assert_array_equal(sampler.covariance(), np.eye(N))
    np.testing.assert_array_equal(sampler.transform(np.arange(N)), np.arange(N))
    assert sampler.condition_number == 1.0


def test_scaling():
    sampler = make()
    learn(sampler)
    before = sampler.covariance()
    x = np.ones(N)
    norm = sampler.norm(x)
    sampler *= 4.0
    np.testing.assert_allclose(sampler.covariance(), 4.0 * before)
    assert sampler.norm(x) == pytest.approx(norm / 2.0)


@pytest.mark.parametrize("device", ["abacus", "cuda:99"])
def test_what_torch_does_not_have(device):
    with pytest.raises(OptimizerError, match=f"cannot use device '{device}'"):
        CMAES(10, np.random.SeedSequence(0), CMAESSettings(population=10, device=device))
