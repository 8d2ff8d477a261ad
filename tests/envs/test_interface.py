"""Checks of options and actions at the boundary."""

import numpy as np
import pytest

from ncrs_envs.interface import ActionError, OptionError, check_action, check_flag, check_options


def test_options_pass_or_name_what_is_wrong():
    assert check_options(None) == {}
    assert check_options({"region": 2}) == {"region": 2}
    with pytest.raises(OptionError, match=r"Unknown reset options \['regions'\]; known are"):
        check_options({"regions": 2})
    with pytest.raises(OptionError, match="either region or scenario"):
        check_options({"region": 0, "scenario": object()})
    with pytest.raises(OptionError, match=r"must be a dict.*got list"):
        check_options(["region"])


@pytest.mark.parametrize("value", ["false", 1, 0, None])
def test_only_booleans_are_flags(value):
    with pytest.raises(OptionError, match="terminate_on_success must be True or False"):
        check_flag(value, "terminate_on_success")


def test_flags():
    assert check_flag(np.True_, "flag") is True
    assert check_flag(False, "flag") is False


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (np.zeros((2, 3)), r"shape \(3, 3\), gas, got \(2, 3\)"),
        (0.5, r"got \(\)"),
        (np.full((3, 3), np.nan), r"finite, got nan at index \(0, 0\)"),
        ([[0, 0, 0], [0, 0, -np.inf], [0, 0, 0]], r"got -inf at index \(1, 2\)"),
        (np.zeros((3, 3), dtype=complex), "real numbers, got dtype complex128"),
        ([["a"] * 3] * 3, "real numbers"),
        (None, "real numbers, got dtype object"),
        ([[1, 2, 3], [1], [1]], "differ in length"),
    ],
)
def test_bad_actions_are_refused(action, message):
    with pytest.raises(ActionError, match=message):
        check_action(action, (3, 3), "gas")


def test_actions_are_copied_as_float32():
    source = np.ones((3, 3), dtype=np.float32)
    action = check_action(source, (3, 3), "gas")
    source[:] = 0.0
    assert action.dtype == np.float32
    assert action.tolist() == [[1.0] * 3] * 3
    assert np.isfinite(check_action(np.full(2, 1e300), (2,), "gas")).all()
