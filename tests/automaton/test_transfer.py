import numpy as np
import pytest

import ncrs
from ncrs.automaton.channels import GenomeError, nca_layout
from ncrs.automaton.transfer import transferred
from ncrs_envs.body import Cell

SEEKER, CARRIER = nca_layout("light_chase"), nca_layout("carry_ball")


def test_it_grows_the_same_body_and_does_the_same(golden_genome, golden):
    record = golden("nca_light")
    compared = 0
    for index in range(16):
        prefix = f"g{index:02d}"
        if not record[f"{prefix}_valid"]:
            continue
        genome = golden_genome(record, prefix)
        carried = transferred(genome, SEEKER, CARRIER)
        assert carried.shape == (4873,)
        seeker, carrier = ncrs.NCA("light_chase"), ncrs.NCA("carry_ball")
        seeker.set_genome(genome)
        carrier.set_genome(carried)
        body = ncrs.grow(seeker)
        grown = ncrs.grow(carrier)
        same = grown != Cell.TARGET_SENSOR
        assert (same & (body != Cell.EMPTY)).any()
        np.testing.assert_array_equal(grown[same], body[same])
        assert (body[~same] != Cell.EMPTY).all()
        observation = np.where(body == Cell.LIGHT_SENSOR, 0.4, 0.0).astype(np.float32)
        actions = [ncrs.Controller(nca, body).act(observation) for nca in (seeker, carrier)]
        np.testing.assert_allclose(*actions, atol=1e-5)
        compared += 1
    assert compared > 3


def test_there_and_back_gives_the_genome_again(genomes):
    genome = genomes(1, 4572)[0]
    again = transferred(transferred(genome, SEEKER, CARRIER), CARRIER, SEEKER)
    np.testing.assert_array_equal(again, genome.astype(np.float32))
    np.testing.assert_array_equal(
        transferred(genome, SEEKER, nca_layout("obstacle")), genome.astype(np.float32)
    )


def test_a_genome_of_another_task_is_refused(genomes):
    with pytest.raises(GenomeError, match="4873"):
        transferred(genomes(1, 4572)[0], CARRIER, SEEKER)
