"""The vector environments of a task, on the CPU's cores or on a GPU."""

from __future__ import annotations

import importlib.util
from functools import partial
from typing import Any

from ncrs_envs.batched import vector_env
from ncrs_envs.batched.vector_base import VectorBase
from ncrs_envs.batched.vector_env import RobotVectorEnv
from ncrs_envs.interface import OptionError
from ncrs_envs.tasks import TASKS, get_task

_ON_THE_CPU = {"threads", "render_size", "render_envs"}
"""Arguments of ``RobotVectorEnv`` that mean nothing on a GPU."""


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
    if str(device) in ("cpu", "cpu:0"):
        name = f"{found.title}VectorEnv"
        own: type[RobotVectorEnv] | None = getattr(vector_env, name, None)
        made: type[RobotVectorEnv] = own or type(name, (RobotVectorEnv,), {"task": found})
        return made(**arguments)
    foreign = sorted(arguments.keys() & _ON_THE_CPU)
    if foreign:
        raise OptionError(
            f"{', '.join(foreign)}: for environments on the CPU only, without device."
        )
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


def __getattr__(name: str) -> Any:
    """Return the maker of a task's environments, ``make_TASK``, which Gymnasium asks for."""
    task = name.removeprefix("make_")
    if task == name or task not in TASKS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return partial(make_task_vector_env, task)
