import numpy as np
import pytest

import ncrs
from ncrs.automaton.growth import regrow
from ncrs.automaton.nca import nca_of
from ncrs.automaton.regrow_to import REPAIR_STEPS, damaged_bodies
from ncrs.automaton.survivor import GAINS, REPAIR_BODY, Survivor
from ncrs_envs import Cell, PerturbationError, PerturbationSettings, parse_body

SMALL = parse_body("LWL/W.W/...")


def test_all_damages_of_a_small_body_are_listed():
    left = damaged_bodies(SMALL, 0.4, np.random.default_rng(0))
    assert len({body.tobytes() for body in left}) == len(left) == 5 + 10
    assert all((body != Cell.EMPTY).sum() in (3, 4) for body in left)
    many = damaged_bodies(np.full((5, 5), 4, dtype=np.int8), 0.5, np.random.default_rng(0))
    assert len(many) == 256
    assert {int((body != 0).sum()) for body in many} == set(range(12, 25))


def test_a_body_grows_back_from_every_damage_of_its_training():
    genome = ncrs.regrow_to(SMALL, "light_chase", fraction=0.2)
    nca = nca_of(genome, "light_chase")
    np.testing.assert_array_equal(ncrs.grow(nca, 3), SMALL)
    for left in (SMALL, *damaged_bodies(SMALL, 0.2, np.random.default_rng(0))):
        np.testing.assert_array_equal(regrow(nca, left, REPAIR_STEPS), SMALL)


def test_a_robot_that_does_not_come_back_keeps_what_it_has():
    nca = nca_of(np.zeros(4572, dtype=np.float32), "light_chase")
    np.testing.assert_array_equal(regrow(nca, SMALL, 3)[SMALL == 0], 0)
    fading = np.zeros(4572, dtype=np.float32)
    fading[-12] = -1.0  # the bias of the body channel
    np.testing.assert_array_equal(regrow(nca_of(fading, "light_chase"), SMALL, 3), SMALL)


def test_settings_are_checked():
    with pytest.raises(PerturbationError, match="at least 1 step"):
        ncrs.regrow_to(SMALL, steps=0)
    with pytest.raises(PerturbationError, match="fraction"):
        ncrs.regrow_to(SMALL, fraction=2.0)


@pytest.mark.slow
def test_the_survivor_drives_on_and_grows_back():
    genome = Survivor(REPAIR_BODY, regrows=True)(GAINS)
    settings = PerturbationSettings(damage_fraction=0.3, damage_until=50, repair_steps=REPAIR_STEPS)
    result = ncrs.evaluate(
        genome, "light_chase", engine="batched", episodes=200, perturbations=settings
    )
    assert result.success.mean() >= 0.85
    assert result.recovered.mean() >= 0.9
