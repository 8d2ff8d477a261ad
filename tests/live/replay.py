"""Episodes of the batched engine, and the same ones replayed by the page's engine."""

from typing import NamedTuple

import numpy as np

import ncrs
from ncrs.automaton.channels import nca_layout
from ncrs.live.world import live_world, placements
from ncrs.report.episodes import record_episodes
from ncrs_envs.scenario import sample_scenarios
from ncrs_envs.tasks import TaskSettings

SIGMAS = (0.05, 0.1, 0.2, 0.3)
CHANGE = 0.02
REPLAY = """
const [world, genomes, scenarios] = arguments;
return genomes.map((text) => {
  const genome = NCRSLive.weights(NCRSLive.bytes(text));
  return scenarios.map((scenario) => NCRSSession.replay(world, genome, scenario));
});
"""


class Robots(NamedTuple):
    """Genomes with the bodies that they grow."""

    genomes: np.ndarray
    bodies: np.ndarray


class Comparison(NamedTuple):
    """Differences of all episodes, one row for each."""

    touched: np.ndarray
    """True if the robot touched something."""
    position_before_contact: np.ndarray
    """Maximum difference of positions up to the first contact, in units."""
    fitness: np.ndarray
    success: np.ndarray
    """True if both say the same."""
    crossed: np.ndarray
    bodies: np.ndarray


def champions_of(task):
    return [
        ncrs.load_champion(name).genome for name in ncrs.champions() if name.startswith(f"{task}/")
    ]


def valid_robots(task, grid_size, genomes):
    """The robots of those genomes whose bodies the task can use."""
    result = ncrs.evaluate(
        np.array(genomes), task, episodes=1, grid_size=grid_size, engine="batched"
    )
    return Robots(np.float32(genomes)[result.valid], result.bodies[result.valid])


def mixed_robots(task, grid_size, random, changed):
    """All champions, some random genomes, and champions that are changed a little."""
    rng = np.random.default_rng(20)
    best = champions_of(task)
    length = nca_layout(task).num_parameters
    drawn = [rng.normal(scale=rng.choice(SIGMAS), size=length) for _ in range(60 * random)]
    near = [best[i % len(best)] + rng.normal(scale=CHANGE, size=length) for i in range(changed)]
    found = valid_robots(task, grid_size, drawn)
    kept = [*best, *found.genomes[:random], *near]
    return valid_robots(task, grid_size, kept)


def compare(page, task, robots, episodes, grid_size=5, seed=3):
    """Record robots with the batched engine, replay them in the page, and compare."""
    from ncrs.report.encoding import pack

    settings = TaskSettings(task, grid_size)
    scenarios = sample_scenarios(task, seed, episodes, grid_size)
    recorded = record_episodes(*robots, scenarios, settings)
    page.driver.set_script_timeout(280)
    replayed = page.js(
        REPLAY,
        live_world(settings, []),
        [pack(genome) for genome in robots.genomes],
        [placements(scenario, grid_size, None) for scenario in scenarios],
    )
    rows = []
    for robot, body in enumerate(robots.bodies):
        for episode in range(episodes):
            again = replayed[robot][episode]
            poses = np.array(again["poses"])
            balls = np.array(again["balls"])
            moved = np.abs(poses - recorded.poses[robot, episode])[:, :2].max(axis=1)
            ball = np.abs(balls - recorded.balls[robot, episode]).max(axis=1)
            first = again["firstTouch"]
            free = slice(None) if first < 0 else slice(first)
            rows.append(
                (
                    first >= 0,
                    np.maximum(moved, ball)[free].max(),
                    abs(again["fitness"] - recorded.fitness[robot, episode]),
                    again["success"] == (recorded.success_steps[robot, episode] >= 0),
                    again["crossed"] == bool((recorded.poses[robot, episode, 1:, 1] > 0).any()),
                    again["body"] == body.reshape(-1).tolist(),
                )
            )
    return Comparison(*map(np.array, zip(*rows, strict=True)))
