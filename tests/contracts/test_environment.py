"""Requirements on every environment of the suite, on either simulator."""

import dataclasses

import numpy as np
import pytest

import ncrs_envs
from ncrs_envs import ActionError, BodyError, Cell, OptionError, Scenario, ScenarioError, TaskError
from ncrs_envs.tasks import get_task, playfield

TASK_OF = {task.env_id: task for task in ncrs_envs.TASKS.values()}


def _drive(env, actions, **reset):
    """Observations, rewards and infos of one episode as flat lists that compare bit by bit."""
    observation, info = env.reset(**reset)
    seen = [(observation.tobytes(), 0.0, info["pose"].tobytes())]
    for action in actions:
        observation, reward, _, _, info = env.step(action)
        seen.append((observation.tobytes(), reward, info["pose"].tobytes()))
    return seen


def _easy(env_id, grid_size=3):
    """A scenario that is solved by driving straight ahead."""
    extent = playfield(grid_size)
    if env_id == "NCRS-CarryBall-v0":
        return Scenario(start=(0.0, -20.0), ball=(0.0, -10.0), target=(0.0, 5.0))
    walls = None
    if "Obstacle" in env_id:
        limit = 1.1 * extent
        walls = ([(-limit, -limit), (-20.0, 4.0)], [(limit, -limit), (20.0, 4.0)])
    return Scenario(start=(0.0, -10.0), light=(0.0, 20.0), walls=walls)


@pytest.fixture
def actions(rng):
    return rng.uniform(-0.5, 1.0, (30, 5, 5)).astype(np.float32)


@pytest.fixture
def rng():
    return np.random.default_rng(5)


@pytest.mark.parametrize("n", [3, 5, 8])
def test_spaces_are_grids(make, n):
    env = make(grid_size=n)
    assert env.observation_space.shape == env.action_space.shape == (n, n)
    assert env.observation_space.dtype == env.action_space.dtype == np.float32
    observation, info = env.reset(seed=0)
    assert observation in env.observation_space
    assert info["body"].shape == (n, n)


def test_info_has_fixed_shapes(make, env_id):
    env = make()
    _, first = env.reset(seed=0)
    *_, later = env.step(np.zeros((5, 5), dtype=np.float32))
    expected = {"body": (5, 5), "sensor_mask": (5, 5), "wheel_mask": (5, 5), "pose": (3,)}
    expected |= {"success": ()}
    if env_id == "NCRS-CarryBall-v0":
        expected |= {"distance_to_ball": (), "ball_to_target": ()}
    else:
        expected |= {"distance": ()}
    if "Obstacle" in env_id:
        expected |= {"crossed": ()}
    for info in (first, later):
        assert {name: np.shape(value) for name, value in info.items()} == expected
        assert info["body"].dtype == np.int8
        assert np.array_equal(info["sensor_mask"], np.isin(info["body"], (2, 3, 5)))
        assert np.array_equal(info["wheel_mask"], info["body"] == 4)


def test_sensors_read_and_all_else_is_zero(make):
    env = make()
    observation, info = env.reset(seed=3)
    assert np.all(observation[info["sensor_mask"] & (info["body"] != Cell.TOUCH_SENSOR)] > 0)
    assert np.all(observation[~info["sensor_mask"]] == 0)


def test_rewards_follow_the_distances_in_info(make, env_id, actions):
    env = make()
    env.reset(seed=2)
    for action in actions[:10]:
        _, reward, _, _, info = env.step(action)
        names = ("distance_to_ball", "ball_to_target") if "distance" not in info else ("distance",)
        scores = [np.exp(-info[name] / 60.0) for name in names]
        assert reward == pytest.approx(np.mean(scores), abs=1e-6)


def test_the_inverse_square_score(make, env_id):
    env = make(distance_score="inverse_square")
    env.reset(seed=2)
    observation, reward, _, _, info = env.step(np.zeros((5, 5), dtype=np.float32))
    names = ("distance_to_ball", "ball_to_target") if "distance" not in info else ("distance",)
    scores = [(info[name] / 60.0 + 1.0) ** -2 for name in names]
    assert reward == pytest.approx(np.mean(scores), abs=1e-6)
    plain, _ = make().reset(seed=2)
    mask = info["sensor_mask"] & (info["body"] != Cell.TOUCH_SENSOR)
    nearer = (1.0 - np.log(plain[mask])) ** -2.0
    assert np.allclose(observation[mask], nearer, rtol=0, atol=1e-4)


def test_equal_seeds_give_equal_episodes(make, actions):
    first, second = make(), make()
    assert _drive(first, actions, seed=11) == _drive(second, actions, seed=11)
    # The second episodes, without a seed, go on from the same generator state.
    assert _drive(first, actions) == _drive(second, actions)
    assert _drive(first, actions, seed=12) != _drive(second, actions, seed=11)


def test_truncation_after_100_steps(make):
    env = make()
    env.reset(seed=0)
    ends = [env.step(np.zeros((5, 5), dtype=np.float32))[2:4] for _ in range(100)]
    assert ends == [(False, False)] * 99 + [(False, True)]


@pytest.mark.parametrize("notation", ["rows", "lists", "array"])
def test_a_body_in_any_notation_is_sticky(make, body, notation):
    grid = ncrs_envs.parse_body(body)
    given = {"rows": body, "lists": grid.tolist(), "array": grid}[notation]
    env = make(body=given)
    for _ in range(2):
        _, info = env.reset()
        assert np.array_equal(info["body"], grid)
    other = np.rot90(grid).copy()
    _, info = env.reset(options={"body": other.tolist()})
    assert np.array_equal(info["body"], other)
    other[:] = 0
    _, info = env.reset()
    assert np.array_equal(info["body"], np.rot90(grid))


def test_success_ends_the_episode_only_if_asked(make, env_id, body):
    scenario, gas = _easy(env_id), np.ones((3, 3), dtype=np.float32)
    open_ended, terminating = make(body=body), make(body=body, terminate_on_success=True)
    _, info = open_ended.reset(options={"scenario": scenario})
    assert not info["success"]
    solved = None
    for k in range(99):
        _, _, terminated, truncated, info = open_ended.step(gas)
        assert not terminated
        assert not truncated
        distance = info["distance"] if "distance" in info else info["ball_to_target"]
        if distance <= TASK_OF[env_id].success_radius:
            solved = k if solved is None else solved
        assert info["success"] == (solved is not None)
    assert solved is not None
    terminating.reset(options={"scenario": scenario})
    ends = [terminating.step(gas)[2] for _ in range(solved + 1)]
    assert ends == [False] * solved + [True]


def test_the_success_radius_is_a_choice(make, env_id, body):
    env = make(body=body, success_radius=1000.0)
    env.reset(seed=0)
    assert env.step(np.zeros((3, 3), dtype=np.float32))[-1]["success"]
    strict = make(body=body, success_radius=1e-6)
    strict.reset(options={"scenario": _easy(env_id)})
    for _ in range(60):
        info = strict.step(np.ones((3, 3), dtype=np.float32))[-1]
    assert not info["success"]


@pytest.mark.parametrize("env_id", ["NCRS-Obstacle-v0"])
def test_crossed_is_above_the_middle_line(make, env_id, body):
    env = make(body=body)
    _, info = env.reset(options={"scenario": _easy(env_id)})
    assert not info["crossed"]
    above = False
    for k in range(99):
        gas = 1.0 if k < 60 else -1.0
        info = env.step(np.full((3, 3), gas, dtype=np.float32))[-1]
        above = above or info["pose"][1] > 0.0
        assert info["crossed"] == above
    assert above


def test_a_region_is_pinned_for_one_episode(make, env_id):
    env = make()
    for region in range(4):
        near = set()
        for seed in range(4):
            _, info = env.reset(seed=seed, options={"region": region})
            scenario = ncrs_envs.sample_scenario(
                TASK_OF[env_id], np.random.default_rng(seed), region
            )
            goal = scenario.ball if scenario.light is None else scenario.light
            distance = info.get("distance", info.get("distance_to_ball"))
            assert distance == pytest.approx(
                np.hypot(*np.subtract(goal, info["pose"][:2])), abs=1e-4
            )
            near.add(round(float(distance), 6))
        assert len(near) == 4


def test_a_scenario_is_replayed_exactly(make, env_id, actions):
    env = make()
    scenario = ncrs_envs.sample_scenarios(TASK_OF[env_id], seed=4, n=1)[0]
    options = {"scenario": scenario}
    first = _drive(env, actions, seed=1, options=options)
    assert _drive(env, actions, seed=2, options=options) == first
    moved = dataclasses.replace(scenario, start=(scenario.start[0] + 0.5, scenario.start[1]))
    assert _drive(env, actions, options={"scenario": moved}) != first
    assert _drive(env, actions, seed=1) != first


BAD_MAKE = [
    ({"body": np.zeros(25, dtype=int)}, BodyError, "2 axes"),
    ({"body": np.ones((5, 5))}, BodyError, "dtype float64"),
    ({"body": np.full((5, 5), 9)}, BodyError, "unknown cell codes"),
    ({"body": np.ones((5, 5), dtype=int)}, BodyError, r"2 wheels \(code 4\), has 0"),
    ({"body": np.full((5, 5), 4)}, BodyError, r"1 SENSOR \(code 2\), has 0"),
    ({"body": np.ones((5, 5), dtype=int), "grid_size": 7}, BodyError, "must be 7 x 7"),
    ({"grid_size": 2}, BodyError, "grid_size must be at least 3"),
    ({"grid_size": 5.0}, BodyError, "grid_size must be an integer"),
    ({"distance_score": "linear"}, TaskError, "distance_score must be one of"),
    ({"success_radius": -1.0}, TaskError, "success_radius must be a positive"),
    ({"success_radius": float("nan")}, TaskError, "success_radius must be a positive"),
    ({"terminate_on_success": "no"}, OptionError, "True or False"),
]


@pytest.mark.parametrize(("arguments", "error", "message"), BAD_MAKE)
def test_bad_make_arguments_are_refused(make, env_id, arguments, error, message):
    sensor = "ball sensor" if "CarryBall" in env_id else "light sensor"
    with pytest.raises(error, match=message.replace("SENSOR", sensor)):
        make(**arguments)


BAD_RESET = [
    ({"body": np.ones((5, 5), dtype=int)}, BodyError, "needs at least"),
    ({"body": np.ones((3, 3), dtype=int)}, BodyError, "must be 5 x 5"),
    ({"body": [[1.5] * 5] * 5}, BodyError, "dtype float64"),
    ({"region": 4}, ScenarioError, "from 0 to 3"),
    ({"region": 1.0}, ScenarioError, "from 0 to 3"),
    ({"scenario": {"start": (0, 0)}}, ScenarioError, "must be an ncrs_envs.Scenario"),
    ({"scenario": Scenario(start=(0, 0))}, ScenarioError, "must have"),
    ({"colour": 1}, OptionError, "Unknown reset options"),
    ({"region": 0, "scenario": Scenario(start=(0, 0))}, OptionError, "either region or"),
]


@pytest.mark.parametrize(("options", "error", "message"), BAD_RESET)
def test_a_refused_reset_changes_nothing(make, actions, options, error, message):
    """Neither the running episode, nor the body, nor the random state."""
    troubled, calm = make(), make()
    for env in (troubled, calm):
        env.reset(seed=3)
        env.step(actions[0])
    with pytest.raises(error, match=message):
        troubled.reset(seed=99, options=options)
    for action in actions[1:5]:
        ours, theirs = troubled.step(action), calm.step(action)
        assert np.array_equal(ours[0], theirs[0])
        assert ours[1] == theirs[1]
    assert _drive(troubled, actions[:3]) == _drive(calm, actions[:3])


@pytest.mark.parametrize(
    "value", [np.nan, np.inf, -np.inf], ids=["nan", "infinity", "minus infinity"]
)
def test_a_refused_action_simulates_nothing(make, actions, value):
    troubled, calm = make(), make()
    for env in (troubled, calm):
        env.reset(seed=3)
    bad = actions[0].copy()
    bad[2, 4] = value
    with pytest.raises(ActionError, match="must be finite"):
        troubled.step(bad)
    for action in actions[:5]:
        ours, theirs = troubled.step(action), calm.step(action)
        assert np.array_equal(ours[0], theirs[0])
        assert ours[1] == theirs[1]


def test_an_action_of_the_wrong_shape_is_refused(make):
    env = make()
    env.reset(seed=0)
    with pytest.raises(ValueError, match="shape"):
        env.step(np.zeros((4, 5), dtype=np.float32))


def test_values_beyond_the_space_are_clipped(make):
    poses = []
    for gas in (1.0, 50.0):
        env = make()
        env.reset(seed=1)
        for _ in range(10):
            info = env.step(np.full((5, 5), gas, dtype=np.float32))[-1]
        poses.append(info["pose"].tolist())
    assert poses[0] == poses[1]


def test_tasks_are_registered_under_their_ids(env_id):
    assert get_task(TASK_OF[env_id].name).env_id == env_id
