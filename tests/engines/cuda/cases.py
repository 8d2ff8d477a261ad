"""Small evaluations in which robots touch the light, walls and the ball from the first steps on.

Run as a script, it evaluates them with the engine ``cuda`` in numba-cuda's simulator, which needs
no GPU: ``NUMBA_ENABLE_CUDASIM=1 python cases.py FILE TASK`` writes the results of a task.
"""

import sys
from dataclasses import replace
from unittest import mock

import numpy as np
import torch

from ncrs.automaton.device_genomes import DeviceGenomes
from ncrs.runs.published import load_champion
from ncrs_envs.scenario import Scenario, sample_scenarios
from ncrs_envs.tasks import TaskSettings

STEPS = 3
EPISODES = {"light_chase": 3, "obstacle": 2, "carry_ball": 2}
TASKS = tuple(EPISODES)
GIVEN = {"light_chase": ["LLLLL/WWWWW/WWWWW/WWWWW/LLLLL", "....L/...W./..#../.W.../L...."]}
"""Bodies that are given instead of grown."""


def genomes(task):
    """Return a champion's genome, and one that grows nothing of use."""
    champion = load_champion(f"{task}/best").genome
    return np.stack([champion, 1e-6 * champion])


def scenarios(task):
    """Return scenarios in which the robot starts at the light, a wall or the ball."""
    drawn = sample_scenarios(task, 1, EPISODES[task])
    if task == "light_chase":
        return [replace(case, light=(3.0 + i, 6.2)) for i, case in enumerate(drawn)]
    if task == "carry_ball":
        return [
            # In front of a prong, or of its edge.
            replace(case, ball=(case.start[0] + 2.0 - i, case.start[1] + 6.1))
            for i, case in enumerate(drawn)
        ]
    cases = []
    for i, case in enumerate(drawn):
        x, y = case.walls[0][-2]
        cases.append(replace(case, start=(x + 4.5, y), light=(x + 4.5, y + 6.0 + i)))
    return cases


def evaluate(engine, module, task):
    """Evaluate the cases of a task in a few steps; starts that overlap a wall are let pass."""
    with (
        mock.patch(f"{module}.MAX_EPISODE_STEPS", STEPS),
        mock.patch.object(Scenario, "_check_start"),
    ):
        return engine(TaskSettings(task)).evaluate(
            genomes(task), scenarios(task), bodies=GIVEN.get(task)
        )


def on_the_gpu(task):
    """Grow genomes that lie on the GPU; return how many were copied to do so, and the bodies."""
    from ncrs.engines.cuda.engine import CUDAEngine

    known = DeviceGenomes(torch.from_numpy(genomes(task)))
    with mock.patch("ncrs.engines.cuda.part.MAX_EPISODE_STEPS", 1):
        bodies = CUDAEngine(TaskSettings(task)).evaluate(known, scenarios(task)[:1]).bodies
    return known.copied, bodies


def main(path, task):
    from ncrs.engines.cuda.engine import CUDAEngine

    result = dict(vars(evaluate(CUDAEngine, "ncrs.engines.cuda.part", task)))
    if task not in GIVEN:
        with mock.patch.object(Scenario, "_check_start"):
            result["copied"], result["bodies_of_device_genomes"] = on_the_gpu(task)
    np.savez(path, **result)


if __name__ == "__main__":
    main(*sys.argv[1:])
