"""Single, synchronous and batched environments through any sequence of calls: all agree."""

import functools

import gymnasium
import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    precondition,
    rule,
    run_state_machine_as_test,
)

import ncrs_envs
from ncrs_envs.errors import NCRSError
from tests.properties.attempts import few_examples

COUNT = 2
BODIES = {
    "carry_ball": ["TLT/WWW/W.W", "LTL/W.W/W#W"], "obstacle_touch": ["CLC/WWW/W.W", "LCL/W.W/W#W"]
}  # fmt: skip
PLAIN = ["L#L/W#W/W#W", "WLW/.#./WLW"]
ALL = sum(BODIES.values(), PLAIN)
"""Two without target sensors, for two of the tasks, and two with them, for CarryBall."""
PLACE = 1e-3
"""Largest distance between the simulators' robots, in units, before anything is touched."""


class Calls(RuleBasedStateMachine):
    """The same calls on Gymnasium's vector of Box2D environments, and on the batched simulator."""

    task = "light_chase"

    @property
    def bodies(self):
        return BODIES.get(self.task, PLAIN)

    @initialize(limit=st.integers(2, 30))
    def make(self, limit):
        env_id = ncrs_envs.get_task(self.task).env_id
        options = {"max_episode_steps": limit, "body": self.bodies[0]}
        # Gymnasium's checker fails itself after a reset that was refused.
        options_of_one = {**options, "disable_env_checker": True}
        make = functools.partial(gymnasium.make, env_id, **options_of_one)
        self.sync = gymnasium.vector.SyncVectorEnv([make] * COUNT)
        self.batched = gymnasium.make_vec(env_id, COUNT, **options)
        self.is_started = False

    def refuse(self, **arguments):
        before = self.batched.scenarios
        # Not Gymnasium's wrapper, which counts a refused reset as one.
        for env in (self.batched, self.sync.envs[0].unwrapped):
            with pytest.raises(NCRSError):
                env.reset(**arguments)
        assert self.batched.scenarios == before

    def compare(self, ours, theirs):
        for a, b in zip(ours, theirs, strict=True):
            np.testing.assert_allclose(a, b, rtol=0, atol=PLACE)

    @rule(
        seed=st.integers(0, 2**31),
        region=st.none() | st.integers(0, 3),
        body=st.none() | st.sampled_from(ALL),
    )
    def reset(self, seed, region, body):
        options = {"region": region, "body": body}
        options = {name: value for name, value in options.items() if value is not None}
        if body not in (None, *self.bodies):
            self.refuse(seed=seed, options=options)
            return
        ours, info = self.batched.reset(seed=seed, options=options)
        theirs, expected = self.sync.reset(seed=seed, options=options)
        self.compare([ours, info["pose"]], [theirs, np.stack(expected["pose"])])
        assert self.batched.scenarios == tuple(env.unwrapped.scenario for env in self.sync.envs)
        np.testing.assert_array_equal(info["body"], np.stack(expected["body"]))
        self.is_started = True

    @precondition(lambda self: not self.is_started)
    @rule()
    def step_too_early(self):
        with pytest.raises(gymnasium.error.ResetNeeded):
            self.batched.step(np.zeros(self.batched.action_space.shape, dtype=np.float32))

    @rule(
        wrong=st.sampled_from(
            [{"region": 4}, {"region": "x"}, {"body": "LL"}, {"colour": 1}, {"scenario": 3}]
        )
    )
    def reset_wrongly(self, wrong):
        self.refuse(options=wrong)

    @precondition(lambda self: self.is_started)
    @rule(left=st.floats(-2, 2), right=st.floats(-2, 2), times=st.integers(1, 5))
    def step(self, left, right, times):
        actions = np.zeros(self.batched.action_space.shape, dtype=np.float32)
        actions[..., 0], actions[..., 2] = left, right
        for _ in range(times):
            ours, theirs = self.batched.step(actions), self.sync.step(actions)
            self.compare(ours[:4], theirs[:4])

    @precondition(lambda self: self.is_started)
    @rule(wrong=st.sampled_from([np.nan, np.inf, "x", None]))
    def step_wrongly(self, wrong):
        before = self.batched.scene(0).pose
        with pytest.raises(NCRSError):
            self.batched.step(np.full(self.batched.action_space.shape, wrong))
        assert self.batched.scene(0).pose == before

    def teardown(self):
        self.sync.close()
        self.batched.close()


@pytest.mark.parametrize("task", sorted(ncrs_envs.TASKS))
def test_any_sequence_of_calls(task):
    machine = type(f"CallsOf_{task}", (Calls,), {"task": task})
    run_state_machine_as_test(machine, settings=settings(max_examples=3 * few_examples()))
