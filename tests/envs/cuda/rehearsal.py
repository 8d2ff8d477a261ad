"""Environments that touch things and end early, on the CPU or in numba-cuda's simulator.

Run as a script, it records them in the simulator, which needs no GPU:
``NUMBA_ENABLE_CUDASIM=1 python rehearsal.py FILE TASK MODE`` writes what every step returns;
``rehearsal.py FILE refusals ""`` the errors, and ``variations ""`` other arguments and options.
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


class Record:
    """What environments return, by name."""

    def __init__(self):
        self.taken = {}

    def take(self, name, value):
        if isinstance(value, dict):
            for key, item in value.items():
                self.take(f"{name}.{key}", item)
        elif isinstance(value, tuple):
            for index, item in enumerate(value):
                self.take(f"{name}.{index}", item)
        elif isinstance(value, np.ndarray) and value.dtype == object:  # of ended episodes only
            blank = np.zeros_like(next(item for item in value if item is not None))
            self.take(name, np.stack([blank if item is None else item for item in value]))
        else:
            self.taken[name] = np.asarray(value)


def record(task, mode, device):
    """Return what environments return, by name and step."""
    notes, made = Record(), np.random.default_rng(0)
    envs = gymnasium.make_vec(
        get_task(task).env_id,
        num_envs=COUNT,
        device=device,
        max_episode_steps=LIMIT,
        autoreset_mode=mode,
    )
    bodies = envs.bodies
    bodies[:3] = ncrs_envs.parse_body(body(task))
    options = {"body": bodies, "region": [0, 1, 2, 3, None]}
    notes.take("reset", envs.reset(seed=11, options=options))
    options = {"reset_mask": np.arange(COUNT) < 2, "scenario": scenario(task)}
    notes.take("pinned", envs.reset(options=options))
    shape = envs.action_space.shape
    for step in range(STEPS):
        actions = torch.from_numpy(made.uniform(-0.5, 1.5, shape).astype(np.float32))
        returned = envs.step(actions)
        notes.take(f"{step}", returned)
        done = np.asarray(returned[2]) | np.asarray(returned[3])
        if mode == "Disabled" and done.any():
            notes.take(f"{step}.restart", envs.reset(options={"reset_mask": done}))
    envs.close()
    return notes.taken


def walls(count):
    """Return a wall's edge with that many vertices, and one with two."""
    heights = np.linspace(-60.0, 0.0, count).tolist()
    return tuple((-20.0, y) for y in heights), ((40.0, -60.0), (12.0, 0.0))


def variations(device):
    """Return what environments of other kinds, with other arguments and options, return."""
    notes = Record()
    # Few cells, an end by success, and no other.
    envs = gymnasium.make_vec(
        "NCRS-LightChase-v0",
        num_envs=3,
        device=device,
        body=torch.tensor(ncrs_envs.parse_body("LWL/W#W/.W.")),
        max_episode_steps=-1,
        distance_score="inverse_square",
        success_radius=30.0,
        terminate_on_success=True,
    )
    notes.take("small", envs.reset(seed=torch.tensor([4, 5, 6])))
    near = ncrs_envs.Scenario((0.0, 0.0), light=(0.0, 29.0))
    notes.take("near", envs.reset(options={"scenario": [None, near, None]}))
    plain = torch.ones(3, 3, 3)
    for step, actions in enumerate(
        (plain.double() * 1e300, plain.int(), plain.mT, plain.clone().requires_grad_())
    ):
        notes.take(f"small {step}", envs.step(actions))
    mask = torch.tensor([True, False, True])
    notes.take("again", envs.reset(options={"reset_mask": mask, "region": torch.tensor([1, 2, 3])}))
    # One of two episodes ends, and another follows at once.
    envs = gymnasium.make_vec(
        "NCRS-LightChase-v0",
        num_envs=2,
        device=device,
        terminate_on_success=True,
        autoreset_mode="SameStep",
    )
    near = ncrs_envs.Scenario((0.0, 0.0), light=(0.0, 19.0))
    notes.take("one", envs.reset(seed=3, options={"scenario": [None, near]}))
    notes.take("one ends", envs.step(torch.ones(2, 5, 5)))
    # More walls than any drawn scenario has, then those of the stream again.
    envs = gymnasium.make_vec("NCRS-Obstacle-v0", num_envs=2, device=device, grid_size=7)
    notes.take("many walls", envs.reset(seed=1))
    crowded = ncrs_envs.Scenario((0.0, -40.0), light=(0.0, 50.0), walls=walls(40))
    options = {"scenario": crowded, "reset_mask": np.array([False, True])}
    notes.take("many walls given", envs.reset(options=options))
    notes.take("many walls step", envs.step(torch.ones(2, 7, 7)))
    notes.take("many walls drawn", envs.reset())
    # A task of one's own.
    ncrs_envs.register_task(replace(get_task("obstacle"), name="mine", env_id="Mine-v0"))
    envs = gymnasium.make_vec("Mine-v0", num_envs=2, device=device)
    notes.take("own", envs.reset(seed=2))
    notes.take("own step", envs.step(torch.ones(2, 5, 5)))
    return notes.taken


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
    note("sparse", lambda: envs.step(still.to_sparse()))
    envs.step(still)
    note("ended", lambda: envs.step(still))
    damage = ncrs_envs.Damage(3, ((0, 0),))
    note("damage", lambda: envs.reset(options={"damage": damage}))
    note("too many", lambda: gymnasium.make_vec("NCRS-Obstacle-v0", 10**6, device="cuda"))
    note("threads", lambda: gymnasium.make_vec("NCRS-Obstacle-v0", 2, device="cuda", threads=1))
    placed = replace(get_task("obstacle"), name="placed", env_id="Placed-v0", place=print)
    ncrs_envs.register_task(placed)
    note("placed", lambda: gymnasium.make_vec("Placed-v0", num_envs=2, device="cuda"))
    note("copied", lambda: copy.deepcopy(envs))
    note("stream", lambda: envs.unwrapped.np_random)
    envs.close()
    note("closed", lambda: envs.step(still))
    return errors


if __name__ == "__main__":
    path, what, mode = sys.argv[1:]
    if what == "refusals":
        taken = refusals()
    elif what == "variations":
        taken = variations("cuda")
    else:
        taken = record(what, mode, "cuda")
    np.savez(path, **taken)
