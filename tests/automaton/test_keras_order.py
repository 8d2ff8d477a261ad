"""Conversion of genomes from and to the published code's order of weights."""

import numpy as np
import pytest

import ncrs
from ncrs.automaton.channels import GenomeError, nca_layout
from ncrs.automaton.nca import nca_of


def _keras_shapes(channels):
    return [(3, 3, channels, 30), (30,), (1, 1, 30, 30), (30,), (1, 1, 30, channels), (channels,)]


def _keras_grow(weights, channels, n=5):
    """Grow a body in Keras' layout, one cell at a time: channels last, kernels as stored there."""
    split = np.split(weights.astype(np.float64), np.cumsum([np.prod(s) for s in SHAPES])[:-1])
    kernel1, bias1, kernel2, bias2, kernel3, bias3 = (
        part.reshape(shape) for part, shape in zip(split, SHAPES, strict=True)
    )
    states = np.zeros((n + 2, n + 2, channels))  # with a border of zeros
    states[1 + n // 2, 1 + n // 2, 0] = 1.0
    for _ in range(5 * (n - n // 2 - 1)):
        after = np.zeros_like(states)
        for row in range(1, n + 1):
            for column in range(1, n + 1):
                around = states[row - 1 : row + 2, column - 1 : column + 2]
                if around[..., 0].max() <= 0.1:
                    continue
                hidden = np.maximum(np.einsum("ijc,ijco->o", around, kernel1) + bias1, 0.0)
                hidden = np.maximum(hidden @ kernel2[0, 0] + bias2, 0.0)
                change = hidden @ kernel3[0, 0] + bias3
                change[1] = 0.0  # the control flag
                after[row, column] = np.clip(states[row, column] + change, -5.0, 5.0)
        states = after
    return states[1:-1, 1:-1]


SHAPES = _keras_shapes(12)


def test_a_genome_grows_in_keras_layout_as_here(golden, golden_genome):
    record = golden("nca_light")
    genome = golden_genome(record, "g00")
    weights = ncrs.convert_to_keras(genome, "light_chase")
    np.testing.assert_allclose(_keras_grow(weights, 12), record["g00_dev_states"][-1], atol=2e-4)
    # The order matters, and nothing says so: the length is the same.
    assert weights.shape == genome.shape
    assert np.abs(_keras_grow(genome, 12) - record["g00_dev_states"][-1]).max() > 0.1


@pytest.mark.parametrize(("task", "length"), [("light_chase", 4572), ("carry_ball", 4873)])
def test_every_weight_of_a_keras_model_finds_its_place(task, length):
    channels = nca_layout(task).channels
    shapes, number = _keras_shapes(channels), np.arange(length, dtype=np.float32)
    ends = np.cumsum([np.prod(shape) for shape in shapes])[:-1]
    model = [part.reshape(s) for part, s in zip(np.split(number, ends), shapes, strict=True)]
    nca = nca_of(ncrs.convert_keras_genome(number, task), task)
    for layer, (kernel, bias) in enumerate(zip(model[::2], model[1::2], strict=True), 1):
        ours = getattr(nca, f"conv{layer}")
        for row, column, source, target in np.ndindex(kernel.shape):
            assert ours.weight[target, source, row, column] == kernel[row, column, source, target]
        np.testing.assert_array_equal(ours.bias.detach().numpy(), bias)
    np.testing.assert_array_equal(ncrs.convert_keras_genome(model, task), nca.genome())
    np.testing.assert_array_equal(ncrs.convert_to_keras(nca.genome(), task), number)


def test_populations_convert_row_by_row(genomes):
    rows = genomes(3).astype(np.float32)
    there = ncrs.convert_to_keras(rows, "obstacle")
    np.testing.assert_array_equal(there[1], ncrs.convert_to_keras(rows[1], "obstacle"))
    np.testing.assert_array_equal(ncrs.convert_keras_genome(there, "obstacle"), rows)


def test_a_champion_in_the_wrong_order_is_nothing():
    champion = ncrs.load_champion("light_chase/best")
    weights = ncrs.convert_to_keras(champion.genome, "light_chase")
    genomes = [weights, ncrs.convert_keras_genome(weights, "light_chase")]
    wrong, right = ncrs.evaluate(genomes, "light_chase", engine="box2d", episodes=4).fitness
    assert wrong == pytest.approx(0.01)
    assert right > 0.6


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        (np.zeros(4873), r"must have shape \(P, 4572\)"),
        (np.full(4572, np.nan), "non-finite"),
        ([np.zeros(s) for s in _keras_shapes(13)], r"shapes \[\(3, 3, 12, 30\)"),
        ([np.zeros((30, 12, 3, 3))], "shapes"),
    ],
)
def test_foreign_weights_are_refused(weights, message):
    with pytest.raises(GenomeError, match=message):
        ncrs.convert_keras_genome(weights, "light_chase")
