"""The published Obstacle robots' bodies at full throttle: ``python -m benchmarks.constructions``.

It drives them, blindly, as one rigid body and in the jointed construction of the published code, on
Box2D and in the same scenarios. Their hulls are so light that the joints give.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import dataclass

import gymnasium
import numpy as np

from ncrs.runs.assessment import Proportion
from ncrs.runs.statistics import NORMAL_95
from ncrs_envs.scenario import sample_scenarios
from ncrs_envs.tasks import CONSTRUCTIONS, MAX_EPISODE_STEPS, OBSTACLE

BODIES: Mapping[str, str] = {
    "arrow": "..W../..W../..W../..W../..L..",
    "fork": ".W.W./.W.W./.WWW./.WLW./..L..",
}
"""Bodies of the robots that the published films show in Obstacle: of CMA-ES, and of CMA-ME."""


@dataclass(frozen=True)
class Drive:
    """Result of driving at full throttle."""

    fitness: float
    half_width: float
    """Half the 95 % interval of the fitness."""
    success: Proportion
    crossed: Proportion


def full_throttle(body: str, construction: str, episodes: int, seed: int) -> Drive:
    """Drive a body through Obstacle with gas 1 in all wheels."""
    env = gymnasium.make(OBSTACLE.env_id, body=body, construction=construction)
    gas = np.ones(env.action_space.shape or (), dtype=np.float32)
    fitness, ends = [], []
    for scenario in sample_scenarios(OBSTACLE, seed, episodes):
        env.reset(options={"scenario": scenario})
        steps = [env.step(gas) for _ in range(MAX_EPISODE_STEPS)]
        fitness.append(np.mean([float(reward) for _, reward, *_ in steps]))
        ends.append(steps[-1][4])
    env.close()
    return Drive(
        fitness=float(np.mean(fitness)),
        half_width=float(NORMAL_95 * np.std(fitness, ddof=1) / np.sqrt(episodes)),
        success=Proportion.of(sum(bool(info["success"]) for info in ends), episodes),
        crossed=Proportion.of(sum(bool(info["crossed"]) for info in ends), episodes),
    )


def main() -> None:
    """Print a row for each body and construction."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--episodes", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0, help="seed for sampling the scenarios")
    options = parser.parse_args()
    print(
        "| body | construction | fitness | success (95 %) | crossed (95 %) |\n|---|---|---|---|---|"
    )
    for name, body in BODIES.items():
        for construction in CONSTRUCTIONS:
            drive = full_throttle(body, construction, options.episodes, options.seed)
            shares = " | ".join(
                "{} ({} to {})".format(*share.percentages())
                for share in (drive.success, drive.crossed)
            )
            fitness = f"{drive.fitness:.4f} +- {drive.half_width:.4f}"
            print(f"| {name} | {construction} | {fitness} | {shares} |", flush=True)


if __name__ == "__main__":
    main()
