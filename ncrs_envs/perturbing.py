"""Sampling of perturbations: the settings, and the records that follow from random numbers.

The numbers come from a stream of their own, in a fixed order. So scenarios have the placements that
they have without perturbations, and a larger fraction takes the same cells and more.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ncrs_envs.perturbations import (
    CellChoice,
    Damage,
    Noise,
    PerturbationError,
    Place,
    Repair,
    WheelFailure,
    check_deviation,
    check_share,
    check_whole,
    mirrored,
)
from ncrs_envs.scenario import Scenario, as_seed_sequence
from ncrs_envs.tasks import MAX_EPISODE_STEPS, RIGID, TaskSettings

SINGLE, PIECE, MIXED = "single", "piece", "mixed"
DAMAGE_KINDS = (SINGLE, PIECE, MIXED)
_STREAM = 2**31
"""Key of the stream, which no episode's placements have."""


# Not frozen: OmegaConf makes frozen dataclasses read-only, so nothing could be overridden.
@dataclass(unsafe_hash=True)
class PerturbationSettings:
    """What happens to robots in the episodes of an evaluation; by default nothing.

    Raises:
        PerturbationError: A setting is out of range.
    """

    damage_fraction: float = 0.0
    """Fraction of its modules that a robot loses, 0 to 1, rounded up; one always stays."""
    damage_step: int = 0
    """Control step at which they vanish; 0 is before the first action."""
    damage_until: int | None = None
    """Last control step at which they may vanish, which is then random, from damage_step on; null
    for damage_step itself."""
    damage_kind: str = MIXED
    """Modules that vanish: single ones anywhere; a piece, those nearest to a random point; or
    mixed, one or the other."""
    damage_generations: int = 0
    """Generations over which the damaged fraction rises to its value; since it is rounded up, one
    module at least is lost from the second generation on."""
    failure_fraction: float = 0.0
    """Fraction of its wheels that get no gas any more, 0 to 1, rounded up."""
    failure_step: int = 0
    """Control step at which they fail."""
    failure_until: int | None = None
    """Last control step at which they may fail, which is then random, from failure_step on; null
    for failure_step itself."""
    share: float = 1.0
    """Share of the episodes with damage and failing wheels, at random."""
    sensor_noise: float = 0.0
    """Standard deviation of normal noise on sensor values, which stay within 0 and 1."""
    state_noise: float = 0.0
    """Standard deviation of normal noise on the automaton's hidden and input/output channels after
    every step of control."""
    repair_steps: int = 0
    """Steps of growth to which the automaton returns to regrow the robot, which rolls on meanwhile,
    one physics step for every two of them; 0 for no repair."""
    repair_every: int = 0
    """Actions between two repairs; 0 for one repair at once after the damage."""

    def __post_init__(self) -> None:
        for name in ("damage_fraction", "failure_fraction", "share"):
            setattr(self, name, check_share(getattr(self, name), name))
        for name in ("sensor", "state"):
            field = f"{name}_noise"
            setattr(self, field, check_deviation(getattr(self, field), name))
        for name in ("damage_generations", "repair_steps", "repair_every"):
            setattr(self, name, check_whole(getattr(self, name), name))
        for name in ("damage", "failure"):
            self._check_steps(f"{name}_step", f"{name}_until")
        if self.damage_kind not in DAMAGE_KINDS:
            raise PerturbationError(
                f"damage_kind must be one of {list(DAMAGE_KINDS)}, got {self.damage_kind!r}."
            )
        if self.repair_every and not self.repair_steps:
            raise PerturbationError(
                f"repair_every={self.repair_every} needs repair_steps, the number of growth steps "
                "of each repair."
            )

    def _check_steps(self, first_name: str, last_name: str) -> None:
        first, last = check_whole(getattr(self, first_name), first_name), getattr(self, last_name)
        if first > MAX_EPISODE_STEPS:
            raise PerturbationError(
                f"{first_name} must lie within the {MAX_EPISODE_STEPS} steps of an episode, got "
                f"{first}."
            )
        if last is not None and not first <= check_whole(last, last_name) <= MAX_EPISODE_STEPS:
            raise PerturbationError(
                f"{last_name} must be null, or lie in {first_name}={first} to "
                f"{MAX_EPISODE_STEPS}, got {last}."
            )

    @property
    def is_any(self) -> bool:
        """True if anything may happen."""
        fractions = (self.damage_fraction, self.failure_fraction)
        return any((*fractions, self.sensor_noise, self.state_noise, self.repair_steps))

    def at(self, generation: int | None) -> PerturbationSettings:
        """Return the settings of a generation, in which the damaged fraction may be smaller.

        Args:
            generation: Index of the generation; None for the settings as they are.
        """
        if generation is None or generation >= self.damage_generations:
            return self
        rise = generation / self.damage_generations
        return replace(self, damage_fraction=self.damage_fraction * rise)

    def draw(self, generator: np.random.Generator, grid_size: int) -> dict[str, Any]:
        """Draw the perturbations of one episode, by the names of the scenario's fields."""
        side = range(grid_size)
        places: list[Place] = [(row, column) for row in side for column in side]
        single = [places[index] for index in generator.permutation(len(places))]
        point = generator.uniform(-0.5, grid_size - 0.5, size=2)
        failing = [places[index] for index in generator.permutation(len(places))]
        is_piece, is_struck, damaged_at, failed_at = generator.random(4)
        seed = int(generator.integers(2**53))
        piece = sorted(places, key=lambda place: float(np.hypot(*(point - place))))
        takes_piece = self.damage_kind == PIECE or (self.damage_kind == MIXED and is_piece < 0.5)
        strikes = is_struck < self.share
        has_noise = self.sensor_noise or self.state_noise
        return {
            "damage": _choice(
                Damage,
                tuple(piece if takes_piece else single),
                self.damage_fraction if strikes else 0.0,
                _step(self.damage_step, self.damage_until, damaged_at),
            ),
            "failure": _choice(
                WheelFailure,
                tuple(failing),
                self.failure_fraction if strikes else 0.0,
                _step(self.failure_step, self.failure_until, failed_at),
            ),
            "noise": Noise(seed, self.sensor_noise, self.state_noise) if has_noise else None,
            "repair": Repair(self.repair_steps, self.repair_every) if self.repair_steps else None,
        }


NO_PERTURBATIONS = PerturbationSettings()
"""Settings with which nothing happens."""


def check_can_change(scenario: Scenario, settings: TaskSettings) -> None:
    """Raise ``PerturbationError`` if a scenario changes the body of a robot with joints."""
    changes = scenario.damage is not None or scenario.repair is not None
    if changes and settings.construction != RIGID:
        raise PerturbationError(
            f"A robot of construction={settings.construction} cannot lose or regrow cells; use "
            f"construction={RIGID}."
        )


def are_perturbed(rows: Iterable[Scenario | Iterable[Scenario]]) -> bool:
    """Return True if anything happens to a robot in any scenario, of one row or of several."""
    return any(
        row.is_perturbed if isinstance(row, Scenario) else are_perturbed(row) for row in rows
    )


def _step(first: int, last: int | None, drawn: float) -> int:
    """Return a step from ``first`` to ``last``, given a number in [0, 1)."""
    return first if last is None else first + int(drawn * (last - first + 1))


def _choice(
    kind: type[CellChoice], cells: tuple[Place, ...], fraction: float, step: int
) -> CellChoice | None:
    return kind(step, cells, fraction) if fraction else None


def perturb(
    scenarios: Sequence[Scenario],
    settings: PerturbationSettings,
    seed: int | Sequence[int] | np.random.SeedSequence,
    grid_size: int,
    flips: Sequence[bool] = (False,),
) -> list[Scenario]:
    """Add perturbations to the scenarios of one evaluation.

    Args:
        scenarios: Scenarios, in sets of mirror images of one draw.
        settings: What happens in them.
        seed: Seed of the scenarios; a longer list begins as a shorter one.
        grid_size: Side of the body grid.
        flips: For each image of a set, True if left and right are exchanged in it: the images of
            one draw have images of one damage.
    """
    if not settings.is_any:
        return list(scenarios)
    base = as_seed_sequence(seed)
    stream = np.random.SeedSequence(base.entropy, spawn_key=(*base.spawn_key, _STREAM))
    perturbed = []
    for index, child in enumerate(stream.spawn(-(-len(scenarios) // len(flips)))):
        drawn = settings.draw(np.random.Generator(np.random.PCG64(child)), grid_size)
        images = scenarios[index * len(flips) : (index + 1) * len(flips)]
        for image, (scenario, flip) in enumerate(zip(images, flips, strict=False)):
            values = _image(drawn, grid_size, flip, image)
            added = {name: value for name, value in values.items() if value is not None}
            perturbed.append(replace(scenario, **added))
    return perturbed


def _image(drawn: dict[str, Any], grid_size: int, flip: bool, image: int) -> dict[str, Any]:
    """Return the perturbations of one image: cells mirrored if asked for, noise of its own."""
    values = dict(drawn)
    if values["noise"] is not None:
        values["noise"] = replace(values["noise"], seed=values["noise"].seed + image)
    if flip:
        for name in ("damage", "failure"):
            if values[name] is not None:
                values[name] = mirrored(values[name], grid_size)
    return values
