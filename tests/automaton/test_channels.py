"""Channels and parameters of the NCA."""

import numpy as np
import pytest

from ncrs.automaton.channels import GenomeError, growth_steps, nca_layout
from ncrs_envs.tasks import TaskError


@pytest.mark.parametrize(
    ("task", "channels", "parameters"),
    [("light_chase", 12, 4572), ("obstacle", 12, 4572), ("carry_ball", 13, 4873)],
)
def test_sizes(task, channels, parameters):
    layout = nca_layout(task)
    assert layout.channels == channels
    assert layout.num_parameters == parameters
    assert layout.io_channel == channels - 1
    assert layout.changing_channels == slice(channels - 7, channels)
    assert layout.part_channels.stop - layout.part_channels.start == len(layout.part_codes)


def test_part_codes_follow_the_channels():
    assert nca_layout("light_chase").part_codes == (1, 2, 4)
    assert nca_layout("carry_ball").part_codes == (1, 2, 3, 4)


def test_every_channel_has_a_name():
    names = nca_layout("carry_ball").channel_names
    assert names[:6] == ["body", "control flag", "tissue", "ball sensor", "target sensor", "wheel"]
    assert names[6:] == [*(f"hidden {index}" for index in range(1, 7)), "input/output"]
    assert nca_layout("obstacle").channel_names[3:5] == ["light sensor", "wheel"]
    for task in ("light_chase", "carry_ball"):
        layout = nca_layout(task)
        assert len(layout.channel_names) == layout.channels


@pytest.mark.parametrize(("grid_size", "steps"), [(3, 5), (4, 5), (5, 10), (7, 15), (15, 35)])
def test_growth_steps(grid_size, steps):
    assert growth_steps(grid_size) == steps


@pytest.mark.parametrize("task", ["light_chase", "carry_ball"])
def test_symmetric_genomes_average_left_and_right(task, genomes):
    layout = nca_layout(task)
    original = genomes(2, layout.num_parameters)
    symmetric = layout.symmetric(original)
    shape = layout.parameter_shapes[0]
    size = int(np.prod(shape))
    kernels = symmetric[0, :size].reshape(shape)
    before = original[0, :size].reshape(shape)
    np.testing.assert_array_equal(kernels, kernels[..., ::-1])
    np.testing.assert_array_equal(kernels[..., 1], before[..., 1])
    np.testing.assert_allclose(kernels[..., 0], before[..., ::2].mean(axis=-1), atol=1e-15)
    np.testing.assert_array_equal(symmetric[:, size:], original[:, size:])
    np.testing.assert_array_equal(layout.symmetric(symmetric), symmetric)


def test_genomes_become_a_float32_matrix():
    checked = nca_layout("light_chase").check_genomes([0.5] * 4572)
    assert checked.shape == (1, 4572)
    assert checked.dtype == np.float32


@pytest.mark.parametrize(
    ("genomes", "message"),
    [
        (np.zeros(4571), r"4572.*4571"),
        (np.zeros((2, 4873)), r"4572.*4873"),
        (np.zeros((0, 4572)), "shape"),
        (np.zeros((1, 1, 4572)), "shape"),
        (np.full(4572, np.nan), "4572 non-finite values"),
        (np.full(4572, 1e300), "4572 non-finite values"),
        (np.zeros(4572, dtype=complex), "complex"),
        (["a"] * 4572, "real numbers"),
    ],
)
def test_bad_genomes_are_refused(genomes, message):
    with pytest.raises(GenomeError, match=message):
        nca_layout("light_chase").check_genomes(genomes)


def test_the_message_names_the_genome_and_the_weight():
    genomes = np.zeros((4, 4572))
    genomes[2, 7] = np.inf
    with pytest.raises(GenomeError, match=r"Genome 2 has 1 non-finite .* index 7"):
        nca_layout("light_chase").check_genomes(genomes)


def test_unknown_task():
    with pytest.raises(TaskError, match="light_chase"):
        nca_layout("chess")
