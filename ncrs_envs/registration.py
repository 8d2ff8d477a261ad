"""Registration of the environments with Gymnasium, by strings: nothing heavy is imported."""

from __future__ import annotations

import gymnasium

from ncrs_envs.tasks import BUILT_IN, MAX_EPISODE_STEPS, TASKS, Task


def register_all() -> None:
    """Register the environments; further calls change nothing."""
    for task in BUILT_IN:
        if task.env_id not in gymnasium.registry:
            gymnasium.register(
                id=task.env_id,
                entry_point=f"ncrs_envs.env:{task.title}Env",
                vector_entry_point=f"ncrs_envs.vector_envs:make_{task.name}",
                max_episode_steps=MAX_EPISODE_STEPS,
            )


def register_task(task: Task) -> None:
    """Make a task known by its name, and its environments by ``task.env_id``.

    Functions of the task must be importable where box2d workers are to run it: define them in a
    module, not in the main script.

    Raises:
        ExtensionError: If another task has that name.
    """
    TASKS.register(task.name, task)
    if task.env_id not in gymnasium.registry:
        gymnasium.register(
            id=task.env_id,
            entry_point="ncrs_envs.env:make_task_env",
            vector_entry_point="ncrs_envs.vector_envs:make_task_vector_env",
            max_episode_steps=MAX_EPISODE_STEPS,
            kwargs={"task": task.name},
        )
