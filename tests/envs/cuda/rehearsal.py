"""Environments that touch things and end early, on the CPU or in numba-cuda's simulator.

Run as a script, it records them in the simulator, which needs no GPU:
``NUMBA_ENABLE_CUDASIM=1 python rehearsal.py FILE TASK MODE`` writes what every step returns;
``rehearsal.py FILE refusals ""`` the errors.
"""

import copy
import sys
from dataclasses import replace

import gymnasium
import numpy as np
import torch

import ncrs_envs
from ncrs_envs.tasks import get_task

COUNT, STEPS, LIMIT = 5, 6, 2
TASKS = ("light_chase", "obstacle", "carry_ball", "obstacle_touch")
MODES = ("NextStep", "SameStep", "Disabled")


def body(task):
    """Return a body that fills its grid, with sensors in front and behind."""
    front = {"carry_ball": "LTLTL", "obstacle_touch": "LCLCL"}.get(task, "LLLLL")
    return f"{front}/WWWWW/WWWWW/WWWWW/{front}"


def scenario(task):
    """Return a scenario in which the robot touches something from the first steps on."""
    case = ncrs_envs.sample_scenarios(task, 7, 3)[2]
    if case.ball is not None:
        return replace(case, ball=(case.start[0] + 1.0, case.start[1] + 6.05))
    if case.walls is None:
        return replace(case, light=(1.0, 6.2))
    x, y = case.start
    while True:  # up to the wall
        y += 0.1
        closer = replace(case, start=(x, y))
        try:
            closer.check(get_task(task), 5)
        except ncrs_envs.ScenarioError:
            return case
        case = closer


def record(task, mode, device):
    """Return what environments return, by name and step."""
    found = get_task(task)
    envs = gymnasium.make_vec(
        found.env_id, num_envs=COUNT, device=device, max_episode_steps=LIMIT, autoreset_mode=mode
    )
    taken, made = {}, np.random.default_rng(0)

    def take(name, value):
        if isinstance(value, dict):
            for key, item in value.items():
                take(f"{name}.{key}", item)
        elif isinstance(value, np.ndarray) and value.dtype == object:  # of ended episodes only
            blank = np.zeros_like(next(item for item in value if item is not None))
            take(name, np.stack([blank if item is None else item for item in value]))
        else:
            taken[name] = np.asarray(value)

    bodies = envs.bodies
    bodies[:3] = ncrs_envs.parse_body(body(task))
    regions = [0, 1, 2, 3, None]
    for name, value in zip(
        ("observation", "info"),
        envs.reset(seed=11, options={"body": bodies, "region": regions}),
        strict=True,
    ):
        take(f"reset.{name}", value)
    mask = np.arange(COUNT) < 2
    options = {"reset_mask": mask, "scenario": scenario(task)}
    for name, value in zip(("observation", "info"), envs.reset(options=options), strict=True):
        take(f"pinned.{name}", value)
    shape = envs.action_space.shape
    for step in range(STEPS):
        actions = made.uniform(-0.5, 1.5, shape).astype(np.float32)
        returned = envs.step(torch.from_numpy(actions) if device != "cpu" else actions)
        names = ("observation", "reward", "terminated", "truncated", "info")
        for name, value in zip(names, returned, strict=True):
            take(f"{step}.{name}", value)
        done = np.asarray(returned[2]) | np.asarray(returned[3])
        if mode == "Disabled" and done.any():
            take(f"{step}.restart", envs.reset(options={"reset_mask": done})[0])
    envs.close()
    return taken


def refusals():
    """Return class and text of the errors that mistakes end in, by mistake."""
    envs = gymnasium.make_vec(
        "NCRS-LightChase-v0",
        num_envs=COUNT,
        device="cuda",
        max_episode_steps=1,
        autoreset_mode="Disabled",
    )
    errors = {}

    def note(name, action):
        try:
            action()
        except Exception as error:
            errors[name] = np.array([type(error).__name__, str(error)])

    still = torch.zeros(COUNT, 5, 5)
    undefined = still.clone()
    undefined[2, 0, 1] = torch.nan
    note("step before reset", lambda: envs.step(still))
    envs.reset(seed=0)
    note("on the CPU's side", lambda: envs.step([[0.0]]))
    note("shape", lambda: envs.step(still.reshape(COUNT, 25)))
    note("complex", lambda: envs.step(still.to(torch.complex64)))
    note("not finite", lambda: envs.step(undefined))
    envs.step(still)
    note("ended", lambda: envs.step(still))
    damage = ncrs_envs.Damage(3, ((0, 0),))
    note("damage", lambda: envs.reset(options={"damage": damage}))
    note("too many", lambda: gymnasium.make_vec("NCRS-Obstacle-v0", 10**6, device="cuda"))
    note("copied", lambda: copy.deepcopy(envs))
    note("stream", lambda: envs.unwrapped.np_random)
    envs.close()
    note("closed", lambda: envs.step(still))
    return errors


if __name__ == "__main__":
    path, what, mode = sys.argv[1:]
    np.savez(path, **(refusals() if what == "refusals" else record(what, mode, "cuda")))
