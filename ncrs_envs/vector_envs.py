"""The vector environments of a task, on the CPU's cores or on a GPU."""

from __future__ import annotations

import importlib.util
from functools import partial
from typing import Any

from ncrs_envs.batched.vector_base import VectorBase
from ncrs_envs.batched.vector_env import VECTOR_ENVS, RobotVectorEnv
from ncrs_envs.interface import OptionError
from ncrs_envs.tasks import CARRY_BALL, LIGHT_CHASE, OBSTACLE, OBSTACLE_TOUCH, get_task


def make_task_vector_env(task: str, device: Any = "cpu", **arguments: Any) -> VectorBase:
    """Make the vector environment of a task.

    Args:
        task: Name of the task.
        device: "cpu", or the GPU: "cuda" or "cuda:INDEX".
        **arguments: Those of ``RobotVectorEnv``; on a GPU those of ``DeviceVectorEnv``.

    Raises:
        TaskError: The task is unknown, or needs Box2D.
        OptionError: The device is unknown, or a package that it needs is missing.
    """
    found = get_task(task)
    if str(device) == "cpu":
        made = VECTOR_ENVS.get(found.name)
        if made is None:
            made = type(f"{found.title}VectorEnv", (RobotVectorEnv,), {"task": found})
        return made(**arguments)
    for module, package in (("torch", "torch"), ("numba_cuda", "numba-cuda")):
        if importlib.util.find_spec(module) is None:
            raise OptionError(
                f"device={device!r} needs the package {package}: pip install 'ncrs[cuda]'."
            )
    from ncrs_envs.cuda.vector_env import DeviceVectorEnv

    on_gpu: type[DeviceVectorEnv] = type(
        f"{found.title}DeviceVectorEnv", (DeviceVectorEnv,), {"task": found}
    )
    return on_gpu(device=device, **arguments)


make_light_chase = partial(make_task_vector_env, LIGHT_CHASE.name)
make_obstacle = partial(make_task_vector_env, OBSTACLE.name)
make_carry_ball = partial(make_task_vector_env, CARRY_BALL.name)
make_obstacle_touch = partial(make_task_vector_env, OBSTACLE_TOUCH.name)
