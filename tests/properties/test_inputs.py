"""Whatever is given as a body, scenario, action or setting is used, or refused with our error."""

import math
from dataclasses import asdict

import gymnasium
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import ncrs_envs
from ncrs.runs.settings import config_from_dict
from ncrs_envs.errors import NCRSError
from tests.properties.attempts import attempt

CELLS = st.sampled_from(".#LTW")
SIDES = st.integers(3, 15)
NUMBERS = st.one_of(
    st.floats(), st.integers(), st.booleans(), st.none(), st.text(max_size=3),
    st.lists(st.floats(), max_size=3), st.complex_numbers(),
)  # fmt: skip


@st.composite
def bodies(draw, side=None):
    """Rows of characters of any square body."""
    n = draw(SIDES) if side is None else side
    return ["".join(draw(st.lists(CELLS, min_size=n, max_size=n))) for _ in range(n)]


@given(bodies())
def test_every_form_of_a_body_is_the_same_body(rows):
    grid = ncrs_envs.parse_body(rows)
    assert grid.shape == (len(rows), len(rows))
    for form in ("/".join(rows), "\n".join(rows), grid, grid.tolist(), grid.astype(np.int64)):
        np.testing.assert_array_equal(ncrs_envs.parse_body(form), grid)


ANYTHING = st.recursive(
    st.one_of(NUMBERS, bodies(3), arrays.arrays(arrays.scalar_dtypes(), (3, 3))),
    lambda inner: st.lists(inner, max_size=4),
    max_leaves=12,
)


@given(ANYTHING)
def test_what_is_no_body_is_refused_with_our_error(value):
    grid, refusal = attempt(ncrs_envs.parse_body, value)
    if refusal is not None:
        assert refusal.endswith(".")
        return
    assert grid.dtype == np.int8
    assert grid.shape[0] == grid.shape[1] >= 3
    assert 0 <= grid.min() <= grid.max() <= 4


@given(
    st.sampled_from(sorted(ncrs_envs.TASKS)),
    st.fixed_dictionaries(
        {"start": st.lists(NUMBERS, max_size=3)},
        optional={name: st.lists(NUMBERS, max_size=3) for name in ("light", "ball", "target")},
    ),
)
def test_what_is_no_scenario_is_refused_with_our_error(task, points):
    try:
        scenario = ncrs_envs.Scenario(**points)
        scenario.check(ncrs_envs.get_task(task), 5)
    except NCRSError:
        return
    assert all(math.isfinite(value) for value in scenario.start)


SETTINGS = st.recursive(
    NUMBERS.filter(lambda value: not isinstance(value, complex)),
    lambda inner: st.dictionaries(st.sampled_from(["name", "sigma", "grid_size", "x"]), inner),
    max_leaves=5,
)
NAMES = [*sorted(asdict(config_from_dict({}))), "sigma", ""]


@given(st.dictionaries(st.sampled_from(NAMES), SETTINGS, max_size=4))
def test_settings_are_taken_whole_or_refused_with_our_error(values):
    config, refusal = attempt(lambda: config_from_dict(values).resolved())
    assert refusal or config_from_dict(asdict(config)) == config


@pytest.fixture(scope="module")
def env():
    env = gymnasium.make("NCRS-LightChase-v0").unwrapped
    env.reset(seed=0)
    return env


@given(value=ANYTHING)
def test_what_is_no_action_is_refused_and_changes_nothing(env, value):
    before = env.scene.pose
    try:
        env.step(value)
    except NCRSError:
        assert env.scene.pose == before
        return
    assert np.isfinite(env.scene.pose).all()
