from dataclasses import asdict, replace

import numpy as np
import pytest

from ncrs_envs import Damage, PerturbationError, PerturbationSettings, sample_scenarios
from ncrs_envs.mirroring import ScenarioSampling, sampling_of
from ncrs_envs.perturbations import mirrored
from ncrs_envs.perturbing import NO_PERTURBATIONS, are_perturbed, perturb

STRONG = PerturbationSettings(
    damage_fraction=0.3, damage_step=5, damage_until=40, failure_fraction=0.2, sensor_noise=0.1,
    repair_steps=6,
)  # fmt: skip
WHOLE = np.ones((5, 5), dtype=np.int8)


def _drawn(settings, n=12, **kwargs):
    return ScenarioSampling(perturbations=settings, **kwargs).draw("light_chase", 3, n)


def test_placements_are_those_without_perturbations():
    plain = sample_scenarios("light_chase", 3, 12)
    drawn = _drawn(STRONG)
    nothing = {"damage": None, "failure": None, "noise": None, "repair": None}
    assert [replace(scenario, **nothing) for scenario in drawn] == plain
    assert are_perturbed([drawn])
    assert not are_perturbed([_drawn(NO_PERTURBATIONS)])
    assert drawn[:5] == _drawn(STRONG, n=5)


def test_a_larger_fraction_takes_the_same_cells_and_more():
    for few, many in zip(_drawn(STRONG), _drawn(replace(STRONG, damage_fraction=0.5)), strict=True):
        lost_few, lost_many = few.damage.left(WHOLE) == 0, many.damage.left(WHOLE) == 0
        assert (lost_few.sum(), lost_many.sum()) == (8, 13)
        assert not (lost_few & ~lost_many).any()
        assert few.damage.step == many.damage.step


def test_steps_spread_over_their_range_and_a_share_is_struck():
    drawn = _drawn(replace(STRONG, share=0.25), n=400)
    struck = [scenario.damage for scenario in drawn if scenario.damage is not None]
    assert 70 <= len(struck) <= 130
    steps = [damage.step for damage in _steps_of(_drawn(STRONG, n=400))]
    assert (min(steps), max(steps)) == (5, 40)
    assert np.mean(steps) == pytest.approx(22.5, abs=1.5)


def _steps_of(scenarios):
    return [scenario.damage for scenario in scenarios]


def test_a_piece_is_nearer_together_than_single_modules():
    def spread(kind):
        drawn = _drawn(replace(STRONG, damage_kind=kind), n=200)
        lost = [np.argwhere(scenario.damage.left(WHOLE) == 0) for scenario in drawn]
        return np.mean([places.std(axis=0).sum() for places in lost])

    assert spread("piece") < 0.8 * spread("single")
    assert spread("piece") < spread("mixed") < spread("single")


def test_mirror_images_have_mirror_images_of_the_damage():
    first, turned, back, side = _drawn(STRONG, n=4, mirroring="all")
    assert turned.damage == side.damage == mirrored(first.damage, 5)
    assert back.damage == first.damage
    assert back.failure == first.failure
    assert len({scenario.noise.seed for scenario in (first, turned, back, side)}) == 4


def test_the_damaged_fraction_rises():
    settings = replace(STRONG, damage_generations=10)
    sampling = ScenarioSampling(perturbations=settings)
    fractions = [
        sampling.draw("light_chase", 0, 1, generation=generation)[0].damage
        for generation in (0, 5, 10, None)
    ]
    assert fractions[0] is None
    assert [damage.fraction for damage in fractions[1:]] == [0.15, 0.3, 0.3]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"damage_fraction": 1.5}, "damage_fraction must lie in 0 to 1"),
        ({"damage_kind": "half"}, "single"),
        ({"damage_step": 101}, "100 steps"),
        ({"damage_step": 9, "damage_until": 8}, "damage_until must be null"),
        ({"repair_every": 5}, "needs repair_steps"),
        ({"state_noise": -1.0}, "state noise"),
    ],
)
def test_settings_out_of_range_are_refused(settings, message):
    with pytest.raises(PerturbationError, match=message):
        PerturbationSettings(**settings)


def test_a_sampling_survives_as_nested_values():
    sampling = ScenarioSampling("front_back", perturbations=STRONG)
    assert sampling_of(asdict(sampling)) == sampling
    values = asdict(ScenarioSampling())
    del values["perturbations"]  # as in archives from before there were any
    assert sampling_of(values) == ScenarioSampling()


def test_settings_without_effect_are_none():
    for settings in ({"share": 0.5}, {"damage_kind": "piece"}, {"damage_until": 50}):
        assert not PerturbationSettings(**settings).is_any
    for settings in ({"repair_steps": 2}, {"sensor_noise": 0.1}, {"failure_fraction": 0.1}):
        assert PerturbationSettings(**settings).is_any


def test_a_scenarios_own_damage_stays_where_none_is_drawn():
    own = replace(sample_scenarios("light_chase", 0, 1)[0], damage=Damage(3, [(1, 1)]))
    (changed,) = perturb([own], PerturbationSettings(repair_steps=4), 0, 5)
    assert changed.damage == own.damage
    assert changed.repair.steps == 4
