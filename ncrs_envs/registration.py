"""Registration of the environments with Gymnasium, by strings: nothing heavy is imported."""

from __future__ import annotations

import gymnasium

from ncrs_envs.tasks import MAX_EPISODE_STEPS, TASKS


def register_all() -> None:
    """Register the three environments; further calls change nothing."""
    for task in TASKS.values():
        if task.env_id not in gymnasium.registry:
            gymnasium.register(
                id=task.env_id,
                entry_point=f"ncrs_envs.env:{task.title}Env",
                vector_entry_point=f"ncrs_envs.batched.vector_env:{task.title}VectorEnv",
                max_episode_steps=MAX_EPISODE_STEPS,
            )
