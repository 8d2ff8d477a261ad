"""The NCA as a torch module."""

import numpy as np
import pytest
import torch
from torch.nn.utils import parameters_to_vector

from ncrs.automaton.channels import GenomeError
from ncrs.automaton.control import Controller
from ncrs.automaton.growth import grow
from ncrs.automaton.nca import NCA, NCAPopulation, NoAutomatonError


@pytest.mark.parametrize("task", ["light_chase", "carry_ball"])
def test_genome_round_trip_is_the_flat_parameter_vector(task, genomes):
    nca = NCA(task)
    vector = genomes(1, nca.num_parameters)[0]
    assert nca.set_genome(vector) is nca
    np.testing.assert_array_equal(nca.genome(), vector.astype(np.float32))
    np.testing.assert_array_equal(parameters_to_vector(nca.parameters()).detach(), nca.genome())
    assert nca.genome().shape == (nca.num_parameters,)


def test_parameter_order_is_weight_and_bias_of_each_layer():
    names = [name for name, _ in NCA().named_parameters()]
    assert names == [f"conv{i}.{kind}" for i in (1, 2, 3) for kind in ("weight", "bias")]
    nca = NCA().set_genome(np.arange(4572, dtype=np.float32))
    assert nca.conv1.weight[0, 0, 0, 1].item() == 1.0
    assert nca.conv1.bias[0].item() == 30 * 12 * 9
    assert nca.conv3.bias[-1].item() == 4571.0


def test_a_genome_can_be_a_tensor_or_a_list():
    nca = NCA().set_genome(torch.ones(4572))
    assert nca.genome().sum() == 4572.0
    assert nca.set_genome([2.0] * 4572).genome().sum() == 2 * 4572.0


@pytest.mark.parametrize(
    "genome",
    [
        np.zeros(10), np.zeros((1, 4572)), np.full(4572, np.inf), 3.0, "genome.npy",
        [[1.0, 2.0], [3.0]],
    ],
)  # fmt: skip
def test_a_bad_genome_is_refused_and_the_weights_stay(genome):
    nca = NCA()
    before = nca.genome()
    with pytest.raises(GenomeError):
        nca.set_genome(genome)
    np.testing.assert_array_equal(nca.genome(), before)


def test_the_update_is_clipped_and_keeps_the_control_flag(genomes):
    nca = NCA().set_genome(genomes(1, sigma=2.0)[0])
    states = torch.randn(3, 12, 5, 5, generator=torch.Generator().manual_seed(0))
    updated = nca(states)
    assert updated.abs().max() == 5.0
    torch.testing.assert_close(updated[:, 1], states[:, 1], rtol=0, atol=0)
    expected = (states + nca.delta(states)).clamp(-5, 5)
    torch.testing.assert_close(updated[:, 2:], expected[:, 2:], rtol=0, atol=0)


def test_zero_padding_and_locality(genomes):
    nca = NCA().set_genome(genomes(1)[0])
    states = torch.zeros(1, 12, 7, 7)
    states[..., 3, 3] = 1.0
    changed = (nca.delta(states) - nca.delta(torch.zeros_like(states))).abs().amax(dim=(0, 1)) > 0
    reached = torch.zeros(7, 7, dtype=torch.bool)
    reached[2:5, 2:5] = True
    torch.testing.assert_close(changed, reached)


@pytest.mark.parametrize("task", ["light_chase", "carry_ball"])
def test_a_population_equals_its_members(task, genomes):
    length = NCA(task).num_parameters
    vectors = genomes(4, length)
    population = NCAPopulation(vectors, task)
    generator = torch.Generator().manual_seed(1)
    states = torch.randn(4, 3, population.channels, 5, 5, generator=generator)
    together = population(states)
    for row, vector in enumerate(vectors):
        alone = NCA(task).set_genome(vector)(states[row])
        torch.testing.assert_close(together[row], alone, rtol=1e-5, atol=1e-5)


def test_a_population_refuses_bad_genomes(genomes):
    vectors = genomes(3)
    vectors[1, 5] = np.nan
    with pytest.raises(GenomeError, match="Genome 1"):
        NCAPopulation(vectors)


def test_stochastic_firing_updates_that_share_of_the_cells(genomes):
    nca = NCA(fire_rate=0.3).set_genome(genomes(1)[0])
    states = torch.zeros(40, 12, 5, 5)
    updated = nca(states, torch.Generator().manual_seed(0))
    share = (updated[:, 2].abs() > 0).float().mean().item()
    assert share == pytest.approx(0.3, abs=0.05)  # 1,000 cells: three standard deviations


def test_state_noise_has_its_standard_deviation():
    nca = NCA(state_noise=0.1).set_genome(np.zeros(4572))
    updated = nca(torch.zeros(40, 12, 5, 5), torch.Generator().manual_seed(0))
    assert updated[:, 2:].std().item() == pytest.approx(0.1, rel=0.05)
    assert updated[:, 1].abs().max() == 0.0


def test_the_options_need_a_seed_to_repeat(genomes):
    nca = NCA(fire_rate=0.5).set_genome(genomes(1)[0])
    states = torch.ones(1, 12, 5, 5)
    draws = [nca(states, torch.Generator().manual_seed(seed)) for seed in (0, 0, 1)]
    assert torch.equal(draws[0], draws[1])
    assert not torch.equal(draws[0], draws[2])


@pytest.mark.parametrize("option", [{"fire_rate": 1.5}, {"state_noise": -0.1}])
def test_options_out_of_range(option):
    with pytest.raises(ValueError, match="must lie in"):
        NCA(**option)


@pytest.mark.parametrize("value", [np.zeros(4572, dtype=np.float32), None, "light_chase/best"])
def test_something_else_in_the_place_of_an_automaton_is_refused(value):
    message = rf"got {type(value).__name__}; of a genome, make one with .*set_genome"
    with pytest.raises(NoAutomatonError, match=message):
        grow(value)
    with pytest.raises(NoAutomatonError, match=message):
        Controller(value, np.full((5, 5), 4, dtype=np.int8))
