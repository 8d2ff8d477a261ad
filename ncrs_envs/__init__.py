"""Gymnasium environments in which modular robots chase a light or carry a ball.

Importing this package registers ``NCRS-LightChase-v0``, ``NCRS-Obstacle-v0``,
``NCRS-CarryBall-v0`` and ``NCRS-ObstacleTouch-v0``. It loads neither torch nor Box2D nor pygame.
"""

from ncrs_envs.body import (
    BodyError,
    Cell,
    body_measures,
    body_to_characters,
    parse_body,
)
from ncrs_envs.curriculum import register_curriculum
from ncrs_envs.interface import ActionError, OptionError
from ncrs_envs.mirroring import register_sampling
from ncrs_envs.perturbations import Damage, Noise, PerturbationError, Repair, WheelFailure
from ncrs_envs.perturbing import PerturbationSettings
from ncrs_envs.registration import register_all, register_task
from ncrs_envs.registry import ExtensionError
from ncrs_envs.scenario import Scenario, ScenarioError, sample_scenario, sample_scenarios
from ncrs_envs.tasks import TASKS, Task, TaskError, get_task, playfield
from ncrs_envs.wrappers import BodyConditionedView, FixedBodyView

register_all()

__all__ = [
    "TASKS",
    "ActionError",
    "BodyConditionedView",
    "BodyError",
    "Cell",
    "Damage",
    "ExtensionError",
    "FixedBodyView",
    "Noise",
    "OptionError",
    "PerturbationError",
    "PerturbationSettings",
    "Repair",
    "Scenario",
    "ScenarioError",
    "Task",
    "TaskError",
    "WheelFailure",
    "body_measures",
    "body_to_characters",
    "get_task",
    "parse_body",
    "playfield",
    "register_all",
    "register_curriculum",
    "register_sampling",
    "register_task",
    "sample_scenario",
    "sample_scenarios",
]
