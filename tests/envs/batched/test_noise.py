import numpy as np
import pytest

from ncrs_envs.batched.noise import normal_value
from ncrs_envs.noise import SENSOR_NOISE, STATE_NOISE, normal_noise


def test_both_simulators_draw_the_same_noise():
    counters = np.array([0, 1, 2, 77, 2**40])
    for seed in (0, 1, 2**62):
        for stream in (SENSOR_NOISE, STATE_NOISE):
            expected = normal_noise(seed, stream, counters)
            drawn = [normal_value(seed, stream, counter) for counter in counters.tolist()]
            np.testing.assert_allclose(drawn, expected, rtol=1e-13)


def test_it_is_normal_and_its_streams_are_unrelated():
    values = normal_noise(5, SENSOR_NOISE, np.arange(100_000))
    assert values.mean() == pytest.approx(0.0, abs=0.01)
    assert values.std() == pytest.approx(1.0, abs=0.01)
    assert (np.abs(values) < 1.96).mean() == pytest.approx(0.95, abs=0.003)
    for other in (
        normal_noise(6, SENSOR_NOISE, np.arange(100_000)),
        normal_noise(5, STATE_NOISE, np.arange(100_000)),
        np.roll(values, 1),
    ):
        assert abs(np.corrcoef(values, other)[0, 1]) < 0.01
