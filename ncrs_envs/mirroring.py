"""Sampling the scenarios of an evaluation: independently, or in mirror images.

What a robot earns by driving blindly depends on the noise of the placements. In mirror images
this noise cancels, so selection acts on what the robot does with its sensors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import cycle
from typing import Any, Literal

import numpy as np

from ncrs_envs.body import DEFAULT_GRID_SIZE
from ncrs_envs.curriculum import NO_CURRICULUM, check_curriculum, eased
from ncrs_envs.perturbing import NO_PERTURBATIONS, PerturbationSettings, perturb
from ncrs_envs.registry import Registry
from ncrs_envs.scenario import (
    NOISE,
    Point,
    Polyline,
    Scenario,
    ScenarioError,
    as_seed_sequence,
    check_noise,
    sample_scenario,
    scenario_streams,
)
from ncrs_envs.tasks import REGIONS, Task, get_task

Mirroring = Literal["none", "front_back", "all"]
MIRRORINGS: tuple[Mirroring, ...] = ("none", "front_back", "all")

AUTO_MIRRORING = "auto"
"""Name for the mirroring that suits the task and the symmetry of the robots."""

Signs = tuple[float, float]
"""Image of a scenario: the signs, 1 or -1, by which x and y are multiplied."""

STANDARD = "standard"
"""Name of the sampling by the task's placements and the mirroring."""
SampleFunction = Callable[[Task, np.random.SeedSequence, int, int], list[Scenario]]
"""Function of task, seed, number of episodes and grid size that samples an evaluation's scenarios;
the same seed gives the same scenarios, and a shorter list is the beginning of a longer one."""
SAMPLINGS: Registry[SampleFunction | None] = Registry("sampling", {STANDARD: None})


def register_sampling(name: str, sample: SampleFunction) -> None:
    """Make a sampling of scenarios known by name; raise ``ExtensionError`` if that is taken."""
    SAMPLINGS.register(name, sample)


def check_sampling(kind: Any) -> str:
    """Return ``kind`` if it is a sampling, else raise ``ScenarioError``."""
    return SAMPLINGS.check(kind, "scenarios", ScenarioError)


def check_mirroring(kind: Any) -> Mirroring:
    """Return ``kind`` if it is a mirroring, else raise ``ScenarioError``."""
    if kind not in MIRRORINGS:
        raise ScenarioError(
            f"mirroring must be one of {list(MIRRORINGS)}, or {AUTO_MIRRORING} in a training run, "
            f"got {kind!r}."
        )
    return kind  # type: ignore[no-any-return]


def resolve_mirroring(kind: Any, task: Task, symmetric: bool) -> Mirroring:
    """Resolve the name of a mirroring.

    Args:
        kind: One of ``MIRRORINGS``, or "auto": all images that make a robot behave differently. For
            robots that treat left and right alike, this is "front_back" in LightChase and "none" in
            the other tasks; for other robots it is "all".
        task: Task of the scenarios.
        symmetric: True if the robots treat left and right alike.

    Raises:
        ScenarioError: ``kind`` is unknown.
    """
    if kind != AUTO_MIRRORING:
        return check_mirroring(kind)
    if not symmetric:
        return "all"
    return "none" if _is_directed(task) else "front_back"


def _is_directed(task: Task) -> bool:
    return task.has_walls or task.has_ball or task.place is not None


def mirror_left_right(scenario: Scenario) -> Scenario:
    """Negate all x of a scenario; the walls change sides."""
    image = _flipped(scenario, -1.0, 1.0)
    return image if image.walls is None else replace(image, walls=image.walls[::-1])


def mirror_front_back(scenario: Scenario) -> Scenario:
    """Negate all y of a scenario; what was in front of the robot, heading +y, is then behind it."""
    image = _flipped(scenario, 1.0, -1.0)
    if image.walls is None:
        return image
    left, right = image.walls
    return replace(image, walls=(left[::-1], right[::-1]))  # from bottom to top again


def _flipped(scenario: Scenario, x: float, y: float) -> Scenario:
    def flip(point: Point) -> Point:
        return (x * point[0], y * point[1])

    def flip_if(point: Point | None) -> Point | None:
        return None if point is None else flip(point)

    def flip_all(line: Polyline) -> Polyline:
        return tuple(flip(point) for point in line)

    walls = scenario.walls
    return replace(
        scenario,
        start=flip(scenario.start),
        light=flip_if(scenario.light),
        ball=flip_if(scenario.ball),
        target=flip_if(scenario.target),
        walls=None if walls is None else (flip_all(walls[0]), flip_all(walls[1])),
    )


def _image(scenario: Scenario, signs: Signs) -> Scenario:
    x, y = signs
    turned = mirror_front_back(scenario) if y < 0.0 else scenario
    return mirror_left_right(turned) if x < 0.0 else turned


def images_and_regions(mirroring: Mirroring, task: Task) -> tuple[Sequence[Signs], Sequence[int]]:
    """Return the images to make of each draw, so that every two episodes cancel, and the regions.

    The draws cycle over the regions.
    """
    same, left_right, front_back, turned = (1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)
    columns = _is_directed(task)
    if mirroring == "none":
        return (same,), range(REGIONS)
    if mirroring == "front_back":
        return (same, front_back), range(REGIONS) if columns else (2, 3)
    if columns:
        return (same, left_right), range(REGIONS)
    return (same, turned, front_back, left_right), (2,)


@dataclass(frozen=True)
class ScenarioSampling:
    """Settings for sampling the scenarios of evaluations; the default is the task's own way."""

    mirroring: Mirroring = "none"
    """Independent scenarios, or mirror images:

    - "none": independent scenarios, as from ``sample_scenarios``.
    - "all": in LightChase sets of four, one light in all four corners, each followed by the
      opposite one; in the other tasks pairs of a draw and its left-right image.
    - "front_back": pairs of a draw and its front-back image, for robots that treat left and right
      alike and so behave the same in left-right images. In LightChase the light is in front of the
      robot, on the right and on the left in turn, and its image is behind. The other tasks never
      place anything behind the robot, so there this is for training only: driving straight on
      does not pay, and the robot must learn to steer.
    """
    noise: float = NOISE
    """Noise of the placements, see ``sample_scenario``."""
    kind: str = STANDARD
    """Name of a sampling: "standard", with the settings above, or one of ``SAMPLINGS``."""
    curriculum: str = NO_CURRICULUM
    """Name of a curriculum, one of ``CURRICULA``, which eases what is drawn for a generation."""
    curriculum_generations: int = 0
    """Generation from which the scenarios are as drawn."""
    perturbations: PerturbationSettings = NO_PERTURBATIONS
    """What happens to the robots; mirror images of a scenario have mirror images of its damage."""

    def check(self) -> ScenarioSampling:
        """Return these settings if all are in range, else raise ``ScenarioError``."""
        check_mirroring(self.mirroring)
        check_noise(self.noise)
        check_sampling(self.kind)
        check_curriculum(self.curriculum)
        return self

    def ease(self, generation: int | None) -> float:
        """Return the curriculum's ease in a generation, 0 to 1; 0 for None."""
        if generation is None or not self.curriculum_generations:
            return 0.0
        return max(0.0, 1.0 - generation / self.curriculum_generations)

    def draw(
        self,
        task: str | Task,
        seed: int | Sequence[int] | np.random.SeedSequence,
        n: int = 12,
        grid_size: int = DEFAULT_GRID_SIZE,
        generation: int | None = None,
    ) -> list[Scenario]:
        """Draw the scenarios of one evaluation.

        Args:
            task: Task or its name.
            seed: Seed for all scenarios; the first sets of a longer evaluation equal those of a
                shorter one.
            n: Number of episodes, at least 1; the last set may be incomplete.
            grid_size: Side of the body grid.
            generation: Generation of a run, which decides how far the curriculum eases the
                scenarios; None for scenarios as they are drawn.

        Raises:
            ScenarioError: ``n`` is not a positive integer, a field is out of range, or the
                curriculum does not suit the task.
            TaskError: The task is unknown.
        """
        task = get_task(task)
        self.check()
        drawn = self._draw(task, seed, n, grid_size)
        easy = eased(drawn, self.curriculum, self.ease(generation), task, grid_size)
        settings = self.perturbations.at(generation)
        return perturb(easy, settings, seed, grid_size, self._flips(task))

    def _flips(self, task: Task) -> Sequence[bool]:
        """Return for each image of a set whether left and right are exchanged in it."""
        if self.kind != STANDARD:
            return (False,)
        return [x < 0.0 for x, _ in images_and_regions(self.mirroring, task)[0]]

    def _draw(
        self, task: Task, seed: int | Sequence[int] | np.random.SeedSequence, n: int, grid_size: int
    ) -> list[Scenario]:
        sample = SAMPLINGS[self.kind]
        if sample is not None:
            return self._drawn_by(sample, task, (as_seed_sequence(seed), n), grid_size)
        images, regions = images_and_regions(self.mirroring, task)
        scenarios: list[Scenario] = []
        for stream, region in zip(scenario_streams(seed, n, len(images)), cycle(regions)):
            drawn = sample_scenario(task, stream, region, grid_size, self.noise)
            scenarios += [_image(drawn, signs) for signs in images]
        return scenarios[:n]

    def _drawn_by(
        self,
        sample: SampleFunction,
        task: Task,
        episodes: tuple[np.random.SeedSequence, int],
        grid_size: int,
    ) -> list[Scenario]:
        """Call a registered sampling and check its scenarios."""
        seed, n = episodes
        scenarios = list(sample(task, seed, n, grid_size))
        if len(scenarios) != n or not all(isinstance(item, Scenario) for item in scenarios):
            raise ScenarioError(
                f"The sampling {self.kind!r} must return a list of {n} scenarios, got "
                f"{scenarios!r:.200}."
            )
        for scenario in scenarios:
            scenario.check(task, grid_size)
        return scenarios


PLAIN_SAMPLING = ScenarioSampling()
"""Sampling in the task's own way."""


def sampling_of(values: Mapping[str, Any]) -> ScenarioSampling:
    """Build a sampling from nested values, such as those of ``dataclasses.asdict``.

    Raises:
        ScenarioError, PerturbationError: A setting is out of range.
        TypeError: A name is unknown.
    """
    given = dict(values)
    perturbations = PerturbationSettings(**given.pop("perturbations", {}))
    return ScenarioSampling(**given, perturbations=perturbations).check()
