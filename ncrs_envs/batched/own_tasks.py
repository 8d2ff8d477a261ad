"""Vector environments of tasks that users register."""

from __future__ import annotations

from typing import Any

from ncrs_envs.batched.vector_env import RobotVectorEnv
from ncrs_envs.tasks import get_task


def make_task_vector_env(task: str, **arguments: Any) -> RobotVectorEnv:
    """Make the vector environment of a registered task, with the arguments of ``RobotVectorEnv``.

    Raises:
        TaskError: If the task is unknown, or needs Box2D.
    """
    found = get_task(task)
    made: type[RobotVectorEnv] = type(f"{found.title}VectorEnv", (RobotVectorEnv,), {"task": found})
    return made(**arguments)
