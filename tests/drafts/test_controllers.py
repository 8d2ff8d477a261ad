"""Controllers that drive any body."""

import numpy as np
import pytest

import ncrs
from ncrs.drafts.controllers import CONTROLLERS, controller_genomes
from ncrs_envs.tasks import CARRY_BALL, LIGHT_CHASE

BODY = "...../.LWL./WWWWW/WWWWW/....."


def test_the_light_is_reached_by_those_that_turn():
    genomes = controller_genomes(LIGHT_CHASE)
    result = ncrs.evaluate(genomes, "light_chase", bodies=BODY, episodes=40, engine="batched")
    success = result.success.mean(axis=1)
    straight, gentle, sharp, still = success
    assert gentle > 0.9
    assert sharp > 0.9
    assert straight < 0.2
    assert still == 0.0
    assert [gains.turn for gains in CONTROLLERS] == [0.0, 20.0, 80.0, 0.0]


@pytest.mark.parametrize("task", [LIGHT_CHASE, CARRY_BALL])
def test_genomes_fit_their_task(task):
    assert controller_genomes(task).shape[1] == ncrs.NCA(task.name).num_parameters
    assert controller_genomes(task).dtype == np.float32
