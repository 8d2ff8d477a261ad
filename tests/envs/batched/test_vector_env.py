"""The vector environments against Gymnasium's sync mode, and what is theirs alone."""

import itertools
import json

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.vector import AutoresetMode

import ncrs_envs
from ncrs_envs import ActionError, BodyError, OptionError, ScenarioError, TaskError
from ncrs_envs.scenario import sample_scenario
from ncrs_envs.tasks import get_task

ENV_IDS = [task.env_id for task in ncrs_envs.TASKS.values()]
MODES = ["NextStep", "SameStep", "Disabled"]


@pytest.fixture(params=ENV_IDS)
def env_id(request):
    return request.param


@pytest.fixture
def make():
    """Makes vector environments and closes them afterwards."""
    made = []

    def maker(env_id, num_envs=3, **kwargs):
        made.append(gymnasium.make_vec(env_id, num_envs, **kwargs))
        return made[-1]

    yield maker
    for envs in made:
        envs.close()


@pytest.fixture
def make_sync(make):
    def maker(env_id, num_envs=3, autoreset_mode="NextStep", **kwargs):
        vector = {"autoreset_mode": autoreset_mode}
        return make(env_id, num_envs, vectorization_mode="sync", vector_kwargs=vector, **kwargs)

    return maker


def _draw_actions(rng, shape, steps):
    return rng.uniform(-0.4, 1.0, (steps, *shape)).astype(np.float32)


def _assert_alike(ours, theirs, path="infos"):
    """Equal keys, shapes and dtypes, and values to within what float32 physics leaves."""
    if isinstance(theirs, dict):
        assert set(ours) == set(theirs), path
        for name, value in theirs.items():
            _assert_alike(ours[name], value, f"{path}[{name!r}]")
    elif isinstance(theirs, np.ndarray) and theirs.dtype == object:
        assert ours.dtype == object
        assert ours.shape == theirs.shape
        for i, (one, other) in enumerate(zip(ours, theirs, strict=True)):
            _assert_alike(one, other, f"{path}[{i}]")
    elif theirs is None:
        assert ours is None, path
    else:
        assert ours.dtype == theirs.dtype, path
        assert ours.shape == theirs.shape, path
        assert np.allclose(ours, theirs, rtol=0, atol=2e-3), path


@pytest.mark.parametrize("mode", MODES)
def test_the_same_as_sync_mode(make, make_sync, rng, env_id, mode):
    """Across two ends of episodes, which come at different steps when success ends them."""
    settings = {"autoreset_mode": mode, "terminate_on_success": True, "success_radius": 43.0}
    pair = make(env_id, **settings), make_sync(env_id, **settings)
    results = [envs.reset(seed=7) for envs in pair]
    _assert_alike(results[0][1], results[1][1])
    ends = set()
    for step, action in enumerate(_draw_actions(rng, (3, 5, 5), 130)):
        ours, theirs = (envs.step(action) for envs in pair)
        assert np.allclose(ours[0], theirs[0], rtol=0, atol=1e-4), step
        for one, other in zip(ours[1:4], theirs[1:4], strict=True):
            assert one.dtype == other.dtype
            assert np.allclose(one, other, rtol=0, atol=1e-4), step
        _assert_alike(ours[4], theirs[4])
        done = theirs[2] | theirs[3]
        ends |= {(step, i) for i in np.flatnonzero(done)}
        if mode == "Disabled" and done.any():
            results = [envs.reset(options={"reset_mask": done.copy()}) for envs in pair]
            assert np.allclose(results[0][0], results[1][0], rtol=0, atol=1e-4)
            _assert_alike(results[0][1], results[1][1])
    assert len(ends) >= 3


@pytest.mark.parametrize("mode", MODES)
def test_metadata_and_spaces(make, make_sync, env_id, mode):
    ours, theirs = make(env_id, autoreset_mode=mode), make_sync(env_id, autoreset_mode=mode)
    assert ours.metadata["autoreset_mode"] is AutoresetMode(mode)
    for name in ("observation_space", "action_space"):
        assert getattr(ours, name) == getattr(theirs, name)
        assert getattr(ours, f"single_{name}") == getattr(theirs, f"single_{name}")
    assert ours.num_envs == 3


def test_each_seed_gives_the_single_environments_scenario(make, env_id):
    envs = make(env_id, 5)
    envs.reset(seed=[4, 9, 1, 4, 30])
    single = gymnasium.make(env_id)
    for seed, scenario in zip([4, 9, 1, 4, 30], envs.unwrapped.scenarios, strict=True):
        single.reset(seed=seed)
        assert scenario == single.unwrapped.scenario
    assert envs.unwrapped.np_random_seed == (4, 9, 1, 4, 30)
    # Without a seed each continues with its own generator.
    single.reset()
    envs.reset()
    assert envs.unwrapped.scenarios[4] == single.unwrapped.scenario
    # A None among the seeds leaves that environment's generator alone.
    single.reset()
    envs.reset(seed=[1, 2, 3, 4, None])
    assert envs.unwrapped.scenarios[4] == single.unwrapped.scenario
    assert envs.unwrapped.scenarios[0] == sample_scenario(
        envs.unwrapped.task, np.random.default_rng(1)
    )
    single.close()


def test_environments_that_are_not_reset_equal_an_undisturbed_twin(make, rng, env_id):
    """Bit by bit, while their neighbours end at other times and get other bodies."""
    settings = {"terminate_on_success": True, "success_radius": 43.0}
    disturbed = make(env_id, 6, autoreset_mode="Disabled", **settings)
    disturbed.reset(seed=11)
    twins = [make(env_id, 1, autoreset_mode="Disabled", **settings) for _ in range(6)]
    for i, twin in enumerate(twins):
        twin.reset(seed=11 + i)
    body = np.rot90(disturbed.unwrapped.bodies[0]).copy()
    resets = 0
    for step, action in enumerate(_draw_actions(rng, (6, 5, 5), 150)):
        ours = disturbed.step(action)
        theirs = [twin.step(action[i : i + 1]) for i, twin in enumerate(twins)]
        for part in range(4):
            expected = np.concatenate([t[part] for t in theirs])
            assert ours[part].tobytes() == expected.tobytes()
        poses = np.concatenate([t[4]["pose"] for t in theirs])
        assert ours[4]["pose"].tobytes() == poses.tobytes()
        # Besides the ends, some are reset before theirs, after which they end later than others.
        done = ours[2] | ours[3] | (np.arange(6) == {15: 0, 40: 3}.get(step, -1))
        if done.any():
            resets += 1
            options = {"body": body} if resets == 1 else {}
            disturbed.reset(options={**options, "reset_mask": done})
            for i in np.flatnonzero(done):
                twins[i].reset(options=options)
    assert resets >= 5


@pytest.mark.parametrize("threads", [2, 3, 8])
def test_results_do_not_depend_on_threads(make, rng, env_id, threads):
    one, many = make(env_id, 300, threads=1), make(env_id, 300, threads=threads)
    assert one.reset(seed=1)[0].tobytes() == many.reset(seed=1)[0].tobytes()
    for action in _draw_actions(rng, (300, 5, 5), 102):
        ours, theirs = one.step(action), many.step(action)
        assert ours[0].tobytes() == theirs[0].tobytes()
        assert ours[1].tobytes() == theirs[1].tobytes()


def test_bodies_of_single_environments_are_sticky(make, random_body, rng, env_id):
    task = next(t for t in ncrs_envs.TASKS.values() if t.env_id == env_id)
    bodies = np.stack([random_body(task) for _ in range(4)])
    envs = make(env_id, 4, max_episode_steps=3)
    _, info = envs.reset(seed=0, options={"body": bodies})
    assert np.array_equal(info["body"], bodies)
    assert np.array_equal(info["wheel_mask"], bodies == 4)
    single = gymnasium.make(env_id)
    for i, action in enumerate(_draw_actions(rng, (4, 5, 5), 4)):
        observations, *_, info = envs.step(action)
        assert np.array_equal(info["body"], bodies)
        assert np.array_equal(observations != 0, (bodies == 2) | (bodies == 3)), i
    single.reset(seed=2, options={"body": bodies[2]})
    observation, _ = envs.reset(seed=0)
    assert np.allclose(observation[2], single.reset(seed=2)[0], rtol=0, atol=1e-6)
    single.close()
    # A mask confines new bodies to the environments that it selects.
    other = np.rot90(bodies, axes=(1, 2)).copy()
    mask = np.array([False, True, False, True])
    _, info = envs.reset(options={"body": other, "reset_mask": mask})
    assert np.array_equal(info["_body"], mask)
    assert np.array_equal(info["body"], np.where(mask[:, None, None], other, 0))
    assert np.array_equal(envs.unwrapped.bodies, np.where(mask[:, None, None], other, bodies))
    mixed = make(env_id, 4, body=bodies.tolist())
    assert np.array_equal(mixed.reset()[1]["body"], bodies)


def test_scenarios_and_regions_of_single_environments(make, env_id):
    envs = make(env_id, 4)
    task = envs.unwrapped.task
    scenarios = ncrs_envs.sample_scenarios(task, seed=3, n=4)
    envs.reset(options={"scenario": scenarios})
    assert envs.unwrapped.scenarios == tuple(scenarios)
    envs.reset(options={"scenario": scenarios[1]})
    assert envs.unwrapped.scenarios == (scenarios[1],) * 4
    envs.reset(seed=5, options={"region": [0, 1, 2, None]})
    for i, region in enumerate([0, 1, 2, None]):
        expected = sample_scenario(task, np.random.default_rng(5 + i), region)
        assert envs.unwrapped.scenarios[i] == expected


def test_the_number_of_steps_is_a_choice(make, env_id):
    zero = np.zeros((2, 5, 5), dtype=np.float32)
    envs = make(env_id, 2, max_episode_steps=4)
    envs.reset(seed=0)
    assert [envs.step(zero)[3].tolist() for _ in range(5)] == [[i == 3] * 2 for i in range(5)]
    endless = make(env_id, 2, max_episode_steps=-1)
    endless.reset(seed=0)
    assert not any(endless.step(zero)[3].any() for _ in range(110))


def test_user_arrays_are_neither_kept_nor_changed(make, env_id):
    envs = make(env_id, 2, autoreset_mode="Disabled")
    mask = np.array([True, False])
    options = {"reset_mask": mask, "region": 1}
    envs.reset(seed=0)
    first, info = envs.reset(options=options)
    assert set(options) == {"reset_mask", "region"}
    kept, pose = first.copy(), info["pose"].copy()
    action = np.full((2, 5, 5), 3.0, dtype=np.float32)
    envs.step(action)
    assert np.all(action == 3.0)
    assert np.array_equal(first, kept)
    assert np.array_equal(info["pose"], pose)
    info["body"][:] = 0
    assert envs.unwrapped.bodies.any()


def test_frames_of_a_chosen_few(make, env_id):
    envs = make(env_id, 6, render_mode="rgb_array", render_size=64, render_envs=[4, 1])
    with pytest.raises(ResetNeeded):
        envs.render()
    envs.reset(seed=0)
    before = envs.render()
    for _ in range(10):
        envs.step(np.ones((6, 5, 5), dtype=np.float32))
    frames = envs.render()
    assert len(frames) == 6
    for env, (frame, earlier) in enumerate(zip(frames, before, strict=True)):
        assert frame.shape == (64, 64, 3)
        assert frame.dtype == np.uint8
        assert np.array_equal(frame, earlier) == (env not in (1, 4))
        assert frame.any() == (env in (1, 4))
    assert envs.unwrapped.scene(4).path.shape == (11, 2)
    assert envs.unwrapped.scene(0).path.shape == (1, 2)
    single = gymnasium.make(env_id, render_mode="rgb_array", render_size=64)
    single.reset(seed=4)
    assert np.abs(single.render().astype(int) - before[4]).mean() < 1.0
    single.close()


def test_specs_can_be_written_and_made_again(make, env_id, random_body):
    task = next(t for t in ncrs_envs.TASKS.values() if t.env_id == env_id)
    body = random_body(task)
    envs = make(env_id, 2, body=body, success_radius=5.0)
    spec = json.loads(envs.unwrapped.spec.to_json())
    assert spec["kwargs"]["body"] == body.tolist()
    again = gymnasium.make_vec(envs.unwrapped.spec)
    assert np.array_equal(again.unwrapped.bodies, np.stack([body, body]))
    again.close()


BODIES = np.full((3, 5, 5), 4)
BODIES[:, 0, 0] = 2
NO_SENSOR = BODIES.copy()
NO_SENSOR[1, 0, 0] = 1

BAD_RESETS = [
    ({"options": {"reset_mask": [True, False, True]}}, TypeError, "numpy array"),
    ({"options": {"reset_mask": np.ones(3)}}, TypeError, "dtype bool"),
    ({"options": {"reset_mask": np.ones(2, dtype=bool)}}, ValueError, r"shape \(3,\)"),
    ({"options": {"reset_mask": np.zeros(3, dtype=bool)}}, ValueError, "at least one"),
    ({"options": {"body": NO_SENSOR}}, BodyError, "Environment 1: .* light sensor"),
    ({"options": {"body": BODIES[:2]}}, BodyError, "each of 3"),
    ({"options": {"body": BODIES[:, :4, :4]}}, BodyError, "must be 5 x 5"),
    ({"options": {"body": BODIES.astype(float)}}, BodyError, "dtype float64"),
    ({"options": {"body": BODIES + 256}}, BodyError, "unknown cell codes"),
    ({"options": {"region": [0, 1]}}, OptionError, "each of 3"),
    ({"options": {"region": [0, 1, 4]}}, ScenarioError, "0 to 3"),
    ({"options": {"scenario": ["a", "b", "c"]}}, ScenarioError, "ncrs_envs.Scenario"),
    ({"options": {"regions": 1}}, OptionError, "Unknown"),
    ({"options": 3}, OptionError, "dict"),
    ({"seed": [1, 2]}, ValueError, "each of 3"),
    ({"seed": "abc"}, OptionError, "seed must be"),
    ({"seed": [1, 2, -3]}, OptionError, "must not be negative"),
    ({"seed": [1, 1.7, 2]}, OptionError, "must be an integer, got 1.7"),
    ({"seed": [True, 1, 2]}, OptionError, "must be an integer, got True"),
]


@pytest.mark.parametrize(("arguments", "error", "message"), BAD_RESETS)
def test_a_refused_reset_changes_nothing(make, rng, arguments, error, message):
    pair = [make("NCRS-LightChase-v0") for _ in range(2)]
    for envs in pair:
        envs.reset(seed=3)
    with pytest.raises(error, match=message):
        pair[0].reset(**arguments)
    for action in _draw_actions(rng, (3, 5, 5), 3):
        ours, theirs = (envs.step(action) for envs in pair)
        assert ours[0].tobytes() == theirs[0].tobytes()
    assert pair[0].reset()[0].tobytes() == pair[1].reset()[0].tobytes()


BAD_MAKES = [
    ({"autoreset_mode": "never"}, OptionError, "autoreset_mode must be one of"),
    ({"render_mode": "human"}, OptionError, "render_mode must be None or 'rgb_array'"),
    ({"render_envs": [3]}, OptionError, "indices from 0 to 2"),
    ({"max_episode_steps": 0}, OptionError, "max_episode_steps must be a positive"),
    ({"threads": 0.5}, OptionError, "threads must be a positive"),
    ({"distance_score": "linear"}, TaskError, "distance_score"),
    ({"body": NO_SENSOR}, BodyError, "Environment 1"),
]


@pytest.mark.parametrize(("arguments", "error", "message"), BAD_MAKES)
def test_bad_make_arguments_are_refused(make, arguments, error, message):
    with pytest.raises(error, match=message):
        make("NCRS-LightChase-v0", **arguments)


def test_num_envs_must_be_positive(make):
    with pytest.raises(OptionError, match="num_envs must be a positive"):
        make("NCRS-LightChase-v0", 0)


def test_steps_out_of_order_are_refused(make):
    action = np.zeros((3, 5, 5), dtype=np.float32)
    envs = make("NCRS-LightChase-v0", autoreset_mode="Disabled", max_episode_steps=1)
    with pytest.raises(ResetNeeded, match="environment 0 has no episode"):
        envs.step(action)
    envs.reset(options={"reset_mask": np.array([True, False, True])})
    with pytest.raises(ResetNeeded, match="environment 1 has no episode"):
        envs.step(action)
    envs.reset()
    envs.step(action)
    with pytest.raises(ResetNeeded, match="have ended"):
        envs.step(action)
    bad = action.copy()
    bad[1, 2, 3] = np.nan
    envs.reset()
    with pytest.raises(ActionError, match=r"\(1, 2, 3\)"):
        envs.step(bad)
    envs.close()
    envs.close()
    for call in (envs.reset, lambda: envs.step(action)):
        with pytest.raises(ClosedEnvironmentError):
            call()


def test_walls_of_any_length_fit(make):
    """A scenario with more wall pieces than any sampled one, in one environment of three."""
    heights = np.linspace(-66.0, 6.0, 60)
    walls = [[(sign * (66.0 - 0.8 * i), y) for i, y in enumerate(heights)] for sign in (-1, 1)]
    long = ncrs_envs.Scenario(start=(0.0, -51.0), light=(0.0, 36.0), walls=walls)
    envs = make("NCRS-Obstacle-v0")
    envs.reset(seed=0)
    envs.reset(options={"scenario": long, "reset_mask": np.array([False, True, False])})
    alone = make("NCRS-Obstacle-v0")
    alone.reset(seed=0)
    gas = np.ones((3, 5, 5), dtype=np.float32)
    for _ in range(60):
        ours, theirs = envs.step(gas), alone.step(gas)
        for i in (0, 2):
            assert ours[0][i].tobytes() == theirs[0][i].tobytes()
    single = gymnasium.make("NCRS-Obstacle-v0")
    single.reset(options={"scenario": long})
    for _ in range(60):
        observation = single.step(gas[0])[0]
    assert np.allclose(ours[0][1], observation, rtol=0, atol=1e-4)
    single.close()


def test_every_task_has_its_class():
    for name, mode in itertools.product(ncrs_envs.TASKS, ["sync", None]):
        envs = gymnasium.make_vec(get_task(name).env_id, 1, vectorization_mode=mode)
        envs.close()
