import numpy as np
import pytest
import torch

from ncrs.automaton.channels import nca_layout
from ncrs.automaton.device_genomes import DeviceGenomes


def make():
    return DeviceGenomes(torch.arange(12, dtype=torch.float64).reshape(3, 4))


def test_only_what_is_asked_for_is_copied():
    genomes = make()
    assert (len(genomes), genomes.shape, genomes.copied) == (3, (3, 4), 0)
    assert genomes[1].tolist() == [4, 5, 6, 7]
    assert genomes[[2, 0]][:, 0].tolist() == [8, 0]
    assert genomes.copied == 3


def test_numpy_takes_it_as_an_array():
    genomes = make()
    array = np.asarray(genomes)
    assert array.dtype == np.float64
    assert array.sum() == 66.0
    assert np.asarray(genomes, dtype=np.float32).dtype == np.float32
    assert np.shape(genomes) == (3, 4)


def test_changing_a_copy_changes_nothing():
    genomes = make()
    np.asarray(genomes)[:] = -1.0
    genomes[0][:] = -1.0
    assert np.asarray(genomes).tolist() == np.arange(12.0).reshape(3, 4).tolist()


def test_the_nearest_symmetric_genomes_are_those_of_numpy():
    layout = nca_layout("light_chase")
    rows = np.random.default_rng(0).standard_normal((3, layout.num_parameters))
    genomes = DeviceGenomes(torch.from_numpy(rows.copy()))
    there = layout.symmetric(genomes)
    assert isinstance(there, DeviceGenomes)
    np.testing.assert_array_equal(np.asarray(there), layout.symmetric(rows))
    np.testing.assert_array_equal(np.asarray(genomes), rows)


def test_no_array_is_made_without_a_copy():
    with pytest.raises(ValueError, match="without a copy"):
        np.asarray(make(), copy=False)
