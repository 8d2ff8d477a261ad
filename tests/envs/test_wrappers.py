"""Views of the environments for ordinary agents."""

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env

import ncrs_envs
from ncrs_envs import ActionError, BodyConditionedView, BodyError, Damage, FixedBodyView
from ncrs_envs.wrappers import DifferentialDrive, SensorDifferences

BODY = ["L#T", "W.W", "##W"]
MOVED = ["W#W", "L.T", "##W"]
LARGER = ["LLT", "W.W", "##W"]
ID = "NCRS-CarryBall-v0"


def _view(cls, **kwargs):
    return cls(gymnasium.make(ID, body=BODY, **kwargs))


def test_vectors_are_the_grids_cells_in_row_order():
    plain = gymnasium.make(ID, body=BODY)
    grid, _ = plain.reset(seed=4)
    view = _view(FixedBodyView)
    vector, _ = view.reset(seed=4)
    assert view.observation_space == gymnasium.spaces.Box(0.0, 1.0, (2,), np.float32)
    assert view.action_space == gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32)
    assert vector.tolist() == [grid[0, 0], grid[0, 2]]
    action = np.array([[0, 0, 0], [0.9, 0, -0.4], [0, 0, 0.2]], dtype=np.float32)
    for _ in range(5):
        grid, reward, *_ = plain.step(action)
        vector, view_reward, *_ = view.step(np.array([0.9, -0.4, 0.2]))
        assert vector.tolist() == [grid[0, 0], grid[0, 2]]
        assert view_reward == reward


def test_parts_may_move_but_not_change_in_number():
    view = _view(FixedBodyView)
    view.reset(seed=0)
    with pytest.raises(BodyError, match="2 sensors and 3 wheels, got one with 3 and 3"):
        view.reset(options={"body": LARGER})
    assert view.get_wrapper_attr("body").tolist() == ncrs_envs.parse_body(BODY).tolist()
    vector, info = view.reset(seed=0, options={"body": MOVED})
    assert info["body"].tolist() == ncrs_envs.parse_body(MOVED).tolist()
    assert np.all(vector > 0)
    for _ in range(3):
        vector, *_, info = view.step(np.zeros(3))
        assert np.all(vector > 0)


@pytest.mark.parametrize("step", [0, 1])
def test_lost_parts_keep_their_places(step):
    plain = gymnasium.make(ID, body=BODY)
    view = _view(FixedBodyView)
    options = {"damage": Damage(step, [(0, 0), (1, 0)])}  # a sensor and a wheel
    plain.reset(seed=4, options=options)
    vector, _ = view.reset(seed=4, options=options)
    assert vector in view.observation_space
    assert (vector > 0).tolist() == [step > 0, True]
    action = np.array([[0, 0, 0], [0.9, 0, -0.4], [0, 0, 0.2]], dtype=np.float32)
    for _ in range(5):
        grid, *_ = plain.step(action)
        vector, *_ = view.step(np.array([0.9, -0.4, 0.2]))
        assert vector.tolist() == [0.0, grid[0, 2]]
    vector, _ = view.reset(seed=4)
    assert np.all(vector > 0)


@pytest.mark.parametrize("step", [0, 1])
def test_aids_are_of_the_whole_body(step):
    env = DifferentialDrive(SensorDifferences(FixedBodyView(gymnasium.make(ID, body=LARGER))))
    env.reset(seed=4, options={"damage": Damage(step, [(0, 0), (1, 0)])})
    env.step(np.array([0.9, -0.4]))
    again = DifferentialDrive(SensorDifferences(FixedBodyView(env.unwrapped)))  # while damaged
    assert again.observation_space == env.observation_space
    assert env.action(np.array([0.9, -0.4])).tolist() == pytest.approx([0.9, -0.4, -0.4])
    seen, *_ = env.step(np.array([0.9, -0.4]))
    values = env.unwrapped.scene.sensor_values
    expected = [0.0, 0.0, 0.0, values[0, 1], values[0, 2], 0.0]
    np.testing.assert_allclose(seen[:6], expected, atol=1e-6)
    assert np.all(seen[6:] != 0.0)


@pytest.mark.parametrize("action", [np.zeros(2), np.zeros((3, 3)), [0.0, np.nan, 0.0]])
def test_bad_vector_actions_are_refused(action):
    view = _view(FixedBodyView)
    view.reset(seed=0)
    pose = view.unwrapped.scene.pose
    with pytest.raises(ActionError):
        view.step(action)
    assert view.unwrapped.scene.pose == pose


def test_the_body_is_part_of_the_observation():
    view = _view(BodyConditionedView)
    observation, _ = view.reset(seed=1)
    assert observation["body"].tolist() == ncrs_envs.parse_body(BODY).tolist()
    assert observation in view.observation_space
    observation, _ = view.reset(options={"body": LARGER})
    assert observation["body"].tolist() == ncrs_envs.parse_body(LARGER).tolist()
    observation, *_ = view.step(np.zeros((3, 3), dtype=np.float32))
    assert observation in view.observation_space
    assert (observation["sensors"] > 0).tolist() == [[True] * 3, [False] * 3, [False] * 3]


@pytest.mark.parametrize("cls", [FixedBodyView, BodyConditionedView])
@pytest.mark.filterwarnings("ignore:.*different from the unwrapped version.*")
def test_views_pass_the_checker_and_survive_in_specs(cls):
    view = _view(cls, terminate_on_success=True)
    check_env(view, skip_render_check=True)
    again = gymnasium.make(EnvSpec.from_json(view.spec.to_json()))
    assert again.observation_space == view.observation_space
    assert again.action_space == view.action_space
    first, _ = view.reset(seed=9)
    second, _ = again.reset(seed=9)
    if cls is FixedBodyView:
        assert np.array_equal(first, second)
    else:
        assert all(np.array_equal(first[key], second[key]) for key in first)
