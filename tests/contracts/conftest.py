"""One interface to a single robot, whichever simulator and however many it runs at once.

A vector environment of one robot is unbatched, so that it goes through the same tests: add a maker
to ``BACKENDS``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest
from numpy.typing import NDArray

import ncrs_envs

ENV_IDS = [task.env_id for task in ncrs_envs.TASKS.values()]
VALID_BODY = {
    "NCRS-LightChase-v0": ["L#L", "W#W", "W#W"],
    "NCRS-Obstacle-v0": ["L#L", "W#W", "W#W"],
    "NCRS-CarryBall-v0": ["LTL", "W#W", "W#W"],
    "NCRS-ObstacleTouch-v0": ["LCL", "W#W", "W#W"],
}


class OneOfMany:
    """The only robot of a vector environment, with the face of a single environment."""

    def __init__(self, env: gymnasium.vector.VectorEnv[Any, Any, Any]) -> None:
        self.env = env
        self.observation_space = env.single_observation_space
        self.action_space = env.single_action_space

    def reset(self, **kwargs: Any) -> tuple[NDArray[Any], dict[str, Any]]:
        observations, infos = self.env.reset(**kwargs)
        return observations[0].copy(), self._unbatch(infos)

    def step(self, action: Any) -> tuple[NDArray[Any], float, bool, bool, dict[str, Any]]:
        observations, rewards, terminated, truncated, infos = self.env.step(np.array([action]))
        return (
            observations[0].copy(),
            float(rewards[0]),
            bool(terminated[0]),
            bool(truncated[0]),
            self._unbatch(infos),
        )

    @staticmethod
    def _unbatch(infos: dict[str, Any]) -> dict[str, Any]:
        return {name: value[0] for name, value in infos.items() if not name.startswith("_")}

    def close(self) -> None:
        self.env.close()


def _box2d(env_id: str, **kwargs: Any) -> Any:
    return gymnasium.make(env_id, **kwargs)


def _box2d_sync(env_id: str, **kwargs: Any) -> Any:
    return OneOfMany(gymnasium.make_vec(env_id, 1, vectorization_mode="sync", **kwargs))


def _batched(env_id: str, **kwargs: Any) -> Any:
    return OneOfMany(gymnasium.make_vec(env_id, 1, **kwargs))


BACKENDS: dict[str, Callable[..., Any]] = {
    "box2d": _box2d,
    "box2d-sync": _box2d_sync,
    "batched": _batched,
}


@pytest.fixture(params=ENV_IDS)
def env_id(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def body(env_id: str) -> list[str]:
    """A 3 x 3 body that the task accepts."""
    return VALID_BODY[env_id]


# Gymnasium makes the second out of the first.
BACKEND_PARAMETERS = ["box2d", pytest.param("box2d-sync", marks=pytest.mark.slow), "batched"]


@pytest.fixture(params=BACKEND_PARAMETERS)
def make(request: pytest.FixtureRequest, env_id: str) -> Iterator[Callable[..., Any]]:
    """Makes the environment under test and closes it afterwards."""
    made = []

    def maker(**kwargs: Any) -> Any:
        made.append(BACKENDS[request.param](env_id, **kwargs))
        return made[-1]

    yield maker
    for env in made:
        env.close()
