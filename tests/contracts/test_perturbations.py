"""Damage, failing wheels, noise and repair: every engine and environment agrees with Box2D."""

import copy
from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from ncrs import evaluate, load_champion
from ncrs.engines.base import EngineSettingError
from ncrs.engines.cuda.engine import CUDAEngine
from ncrs_envs import (
    Damage,
    Noise,
    PerturbationError,
    PerturbationSettings,
    Repair,
    Scenario,
    ScenarioError,
    WheelFailure,
    parse_body,
    sample_scenarios,
)
from ncrs_envs.batched.perturbations import lose_cells, mark_failing
from ncrs_envs.tasks import TaskSettings

EPISODES = 6


def _order(rng):
    return [divmod(int(place), 5) for place in rng.permutation(25)]


def _scenarios(task, *names, episodes=EPISODES):
    rng = np.random.default_rng(1)
    made = []
    for index, scenario in enumerate(sample_scenarios(task, 1, episodes)):
        values = {
            "damage": Damage(7 * index, _order(rng), 0.3),
            "failure": WheelFailure(5 * index, _order(rng), 0.4),
            "noise": Noise(index, 0.02, 0.02),
            "repair": Repair(9, 11 if index % 2 else 0),
        }
        made.append(replace(scenario, **{name: values[name] for name in names}))
    return made


def _genomes(task):
    champion = load_champion(f"{task}/best").genome
    mutant = champion + np.random.default_rng(2).normal(0, 0.02, champion.size)
    return np.stack([champion, mutant.astype(np.float32)])


@pytest.mark.parametrize(
    ("task", "names"),
    [
        ("light_chase", ("damage",)),
        ("light_chase", ("failure", "noise")),
        ("light_chase", ("damage", "repair")),
        ("carry_ball", ("damage", "failure", "noise", "repair")),
        ("obstacle", ("damage", "repair")),
    ],
)
def test_the_batched_engine_agrees_with_box2d(task, names):
    scenarios, genomes = _scenarios(task, *names), _genomes(task)
    fast, reference = (
        evaluate(genomes, task, engine=engine, scenarios=scenarios, workers=1)
        for engine in ("batched", "box2d")
    )
    np.testing.assert_allclose(fast.episode_fitness, reference.episode_fitness, atol=3e-3)
    np.testing.assert_array_equal(fast.success, reference.success)
    np.testing.assert_allclose(fast.recovered, reference.recovered, atol=0.1)
    plain = evaluate(genomes, task, engine="batched", episodes=EPISODES, seed=1)
    assert np.abs(plain.episode_fitness - fast.episode_fitness).max() > 0.01
    assert (plain.recovered == 1.0).all()
    if "repair" in names:
        assert 0.0 < fast.recovered[fast.valid].mean() < 1.0


def test_without_an_event_the_results_are_the_same_bit_by_bit():
    scenarios, genomes = sample_scenarios("light_chase", 1, 7), _genomes("light_chase")
    for engine in ("batched", "box2d"):
        plain, eventless = (
            evaluate(genomes, "light_chase", engine=engine, scenarios=chosen, workers=1)
            for chosen in (scenarios, [replace(s, repair=Repair(4)) for s in scenarios])
        )
        for name, values in vars(plain).items():
            np.testing.assert_array_equal(values, getattr(eventless, name), err_msg=name)


def test_a_mixture_of_episodes_has_each_ones_own_result():
    hurt, genomes = _scenarios("light_chase", "damage", "noise"), _genomes("light_chase")
    plain = sample_scenarios("light_chase", 9, 3)
    mixed = evaluate(genomes, "light_chase", engine="batched", scenarios=[*plain, *hurt])
    for part, rows in ((plain, slice(3)), (hurt, slice(3, None))):
        alone = evaluate(genomes, "light_chase", engine="batched", scenarios=part)
        np.testing.assert_array_equal(mixed.episode_fitness[:, rows], alone.episode_fitness)


def test_engines_that_cannot_simulate_it_refuse():
    engine = CUDAEngine.__new__(CUDAEngine)  # made without a GPU
    engine.settings = TaskSettings()
    rows = [_scenarios("light_chase", "damage")]
    with pytest.raises(EngineSettingError, match=r"engine=cuda simulates no damage.*batched"):
        engine._rollout(np.zeros((1, 4572), dtype=np.float32), rows, lambda: False, None)


def test_kernels_choose_the_cells_that_the_records_choose():
    rng = np.random.default_rng(4)
    for fraction in (None, 0.0, 0.3, 1.0):
        body = rng.choice(np.array([0, 1, 2, 4], dtype=np.int8), (5, 5))
        cells = _order(rng)[: int(rng.integers(3, 26))]
        order = np.full(25, -1)
        order[: len(cells)] = [5 * row + column for row, column in cells]
        left, fails = np.empty_like(body), np.empty(25, dtype=np.bool_)
        share = -1.0 if fraction is None else fraction
        lose_cells(body, order, share, left)
        np.testing.assert_array_equal(left, Damage(0, cells, fraction).left(body))
        mark_failing(body, order, share, fails)
        expected = WheelFailure(0, cells, fraction).failed(body)
        np.testing.assert_array_equal(fails.reshape(5, 5), expected)


def test_touch_sensors_remember_through_damage():
    """They fade as before, whichever other cells are lost, and have no noise."""
    walls = (((-66.0, -66.0), (-1.0, 6.0)), ((66.0, -66.0), (1.0, 6.0)))
    body = parse_body("C.L.C/.WWW./WWWWW/...../.....")
    scenario = Scenario((0.0, -20.0), light=(0.0, 36.0), walls=walls)
    scenario = replace(scenario, damage=Damage(45, [(0, 4), (2, 1)]), noise=Noise(1, 0.05))
    many = gymnasium.make_vec("NCRS-ObstacleTouch-v0", 1, body=body)
    single = gymnasium.make("NCRS-ObstacleTouch-v0", body=body)
    many.reset(options={"scenario": scenario})
    single.reset(options={"scenario": scenario})
    felt = []
    for step in range(60):
        gas = np.full((5, 5), 1.0 if step < 40 else -1.0, dtype=np.float32)
        observations, *_ = many.step(gas[None])
        observation, *_ = single.step(gas)
        np.testing.assert_allclose(observations[0], observation, atol=1e-3)
        felt.append(float(observation[0, 0]))
    assert max(felt) == 1.0
    assert 0.0 < felt[46] < felt[44] < 1.0
    assert felt[46] == pytest.approx(0.8**2 * felt[44], rel=1e-5)


@pytest.mark.parametrize("env_id", ["NCRS-LightChase-v0", "NCRS-CarryBall-v0"])
def test_vector_environments_agree_with_single_ones(env_id):
    task = gymnasium.make(env_id).unwrapped.task.name
    scenarios = _scenarios(task, "damage", "failure", "noise", episodes=3)
    rng = np.random.default_rng(3)
    many = gymnasium.make_vec(env_id, 3)
    single = [gymnasium.make(env_id) for _ in range(3)]
    whole = many.unwrapped.bodies
    for options in ({"scenario": scenarios}, {"damage": Damage(4, [(2, 2), (1, 1)])}, {}):
        given = options.get("scenario")
        observations, infos = many.reset(seed=1, options=options)
        for index, env in enumerate(single):
            own = options if given is None else {"scenario": given[index]}
            observation, info = env.reset(seed=1 + index, options=own)
            np.testing.assert_allclose(observations[index], observation, atol=1e-6)
            np.testing.assert_array_equal(infos["body"][index], info["body"])
        for _ in range(20):
            actions = rng.uniform(-1, 1, observations.shape).astype(np.float32)
            observations, rewards, _, _, infos = many.step(actions)
            for index, env in enumerate(single):
                observation, reward, _, _, info = env.step(actions[index])
                np.testing.assert_allclose(observations[index], observation, atol=1e-6)
                assert rewards[index] == pytest.approx(reward, abs=1e-6)
                np.testing.assert_array_equal(infos["body"][index], info["body"])
        lost = (infos["body"] != whole).sum()
        assert lost > 0 if options else lost == 0


def test_damage_takes_cells_at_its_step_and_a_reset_brings_them_back():
    env = gymnasium.make("NCRS-LightChase-v0")
    damage = Damage(2, [(1, 1), (3, 3)])
    _, info = env.reset(seed=0, options={"damage": damage})
    whole = info["body"]
    assert whole[1, 1] == 2
    push = np.ones((5, 5), dtype=np.float32)
    env.step(push)
    speed = env.unwrapped._episode.world.twist
    observation, _, _, _, info = env.step(push)
    assert info["body"][1, 1] == info["body"][3, 3] == observation[1, 1] == 0
    assert env.unwrapped.body[1, 1] == 0
    assert env.unwrapped._episode.world.twist[1] > speed[1]
    twin = copy.deepcopy(env.unwrapped)
    for _ in range(3):
        ours, theirs = env.step(push), twin.step(push)
        np.testing.assert_array_equal(ours[0], theirs[0])
    _, info = env.reset(seed=0)
    np.testing.assert_array_equal(info["body"], whole)


def test_a_robot_with_joints_keeps_its_cells():
    env = gymnasium.make("NCRS-LightChase-v0", construction="jointed")
    with pytest.raises(PerturbationError, match="construction=rigid"):
        env.reset(options={"damage": Damage(0, [(1, 1)])})
    with pytest.raises(PerturbationError, match="construction=rigid"):
        evaluate(
            _genomes("light_chase"),
            "light_chase",
            construction="jointed",
            scenarios=_scenarios("light_chase", "repair"),
        )


def test_a_malformed_damage_is_refused():
    env = gymnasium.make("NCRS-LightChase-v0")
    many = gymnasium.make_vec("NCRS-LightChase-v0", 2)
    for made in (env, many):
        with pytest.raises(PerturbationError, match="5 x 5"):
            made.reset(options={"damage": Damage(0, [(7, 0)])})
        with pytest.raises(PerturbationError, match=r"must be an ncrs_envs\.Damage"):
            made.reset(options={"damage": 0.3})


@pytest.mark.parametrize("engine", ["batched", "box2d"])
def test_only_modules_that_damage_took_can_come_back(engine):
    """Repairs before the damage change this champion's body, which is no loss to damage."""
    genome = load_champion("light_chase/best").genome
    drawn = sample_scenarios("light_chase", 1, 1)[0]
    nothing = replace(drawn, repair=Repair(10, 20), damage=Damage(60, []))
    some = replace(nothing, damage=Damage(60, [(0, 0), (2, 2)]))
    result = evaluate(genome, "light_chase", engine=engine, scenarios=[nothing, some], workers=1)
    assert result.recovered[0, 0] == 1.0
    assert result.recovered[0, 1] in (0.0, 0.5, 1.0)


def test_given_scenarios_hold_their_own_perturbations():
    genome = load_champion("light_chase/best").genome
    drawn = sample_scenarios("light_chase", 1, 2)
    settings = PerturbationSettings(damage_fraction=0.3)
    with pytest.raises(ScenarioError, match="Leave one of the two out"):
        evaluate(genome, "light_chase", scenarios=drawn, perturbations=settings)
    with pytest.raises(ScenarioError, match="must be a sequence"):
        evaluate(genome, "light_chase", scenarios=[None])
