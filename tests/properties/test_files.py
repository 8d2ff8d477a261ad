"""Files of which bytes were changed are read as they were written, or refused with our error."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from ncrs.runs.checkpoint import read_state, write_state
from ncrs.runs.settings import TrainConfig, load_config, save_config
from tests.properties.attempts import attempt

VALUES = st.recursive(
    st.one_of(
        st.none(), st.booleans(), st.integers(-(2**53), 2**53), st.text(max_size=5),
        st.floats(allow_nan=False, allow_infinity=False),
        arrays.arrays(st.sampled_from(["f4", "f8", "i8", "i1", "?"]), arrays.array_shapes()),
    ),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=8,
)  # fmt: skip


def equal(first, second):
    """True for equal nested values, of the same dtypes."""
    if isinstance(first, dict):
        return first.keys() == second.keys() and all(equal(first[k], second[k]) for k in first)
    if isinstance(first, list):
        return len(first) == len(second) and all(map(equal, first, second))
    if isinstance(first, np.ndarray):
        are_floats = first.dtype.kind == "f"
        return first.dtype == second.dtype and np.array_equal(first, second, are_floats)
    return type(first) is type(second) and first == second


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("files")


@given(state=st.dictionaries(st.text(max_size=4), VALUES, max_size=4))
def test_what_is_written_is_read(place, state):
    write_state(place / "state.npz", state)
    assert equal(read_state(place / "state.npz"), state)


@pytest.fixture(scope="module")
def small(place):
    """A small checkpoint, and its content."""
    state = {"mean": np.arange(3.0), "name": "x", "inner": {"count": 2}}
    write_state(place / "small.npz", state)
    return (place / "small.npz").read_bytes(), state


def check(place, content, state):
    path = place / "changed.npz"
    path.write_bytes(content)
    found, refusal = attempt(read_state, path)
    assert "changed.npz" in refusal if refusal else equal(found, state)


@pytest.mark.parametrize("change", [0x01, 0x80, 0xFF])
def test_every_byte_of_a_checkpoint_counts_or_does_no_harm(place, small, change):
    content, state = small
    for index in range(len(content)):
        changed = bytearray(content)
        changed[index] ^= change
        check(place, bytes(changed), state)


def test_a_checkpoint_cut_anywhere_is_refused(place, small):
    content, state = small
    for length in range(len(content)):
        check(place, content[:length], state)


@given(data=st.data())
def test_a_checkpoint_of_which_a_part_was_replaced(place, small, data):
    content, state = small
    start = data.draw(st.integers(0, len(content)))
    end = data.draw(st.integers(start, len(content)))
    check(place, content[:start] + data.draw(st.binary(max_size=30)) + content[end:], state)


@given(data=st.data())
def test_settings_of_which_a_part_was_replaced(place, data):
    save_config(TrainConfig(), place)
    content = (place / "config.json").read_bytes()
    start = data.draw(st.integers(0, len(content)))
    end = data.draw(st.integers(start, min(len(content), start + 40)))
    changed = content[:start] + data.draw(st.binary(max_size=10)) + content[end:]
    (place / "config.json").write_bytes(changed)
    config, refusal = attempt(lambda: load_config(place).resolved())
    assert refusal or isinstance(config, TrainConfig)
