"""The environments as Gymnasium registers them: data only, nothing heavy is imported."""

from __future__ import annotations

import gymnasium

from ncrs_envs.tasks import MAX_EPISODE_STEPS, TASKS

_ENTRY_POINTS = {
    "light_chase": "ncrs_envs.env:LightChaseEnv",
    "obstacle": "ncrs_envs.env:ObstacleEnv",
    "carry_ball": "ncrs_envs.env:CarryBallEnv",
}


def register_all() -> None:
    """Register the three environments; calling it again changes nothing."""
    for name, entry_point in _ENTRY_POINTS.items():
        env_id = TASKS[name].env_id
        if env_id not in gymnasium.registry:
            gymnasium.register(
                id=env_id,
                entry_point=entry_point,
                max_episode_steps=MAX_EPISODE_STEPS,
            )
