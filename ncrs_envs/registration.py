"""The environments as Gymnasium registers them: data only, nothing heavy is imported."""

from __future__ import annotations

import gymnasium

from ncrs_envs.tasks import MAX_EPISODE_STEPS, TASKS

_CLASS_NAMES = {"light_chase": "LightChase", "obstacle": "Obstacle", "carry_ball": "CarryBall"}


def register_all() -> None:
    """Register the three environments; calling it again changes nothing."""
    for name, class_name in _CLASS_NAMES.items():
        env_id = TASKS[name].env_id
        if env_id not in gymnasium.registry:
            gymnasium.register(
                id=env_id,
                entry_point=f"ncrs_envs.env:{class_name}Env",
                vector_entry_point=f"ncrs_envs.batched.vector_env:{class_name}VectorEnv",
                max_episode_steps=MAX_EPISODE_STEPS,
            )
