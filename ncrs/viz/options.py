"""Options of films and figures; light to import, for the command line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from ncrs.viz.errors import VizError
from ncrs_envs.perturbing import NO_PERTURBATIONS, PerturbationSettings

MIN_HEIGHT, MAX_HEIGHT = 240, 1440
"""Limits of a film's height in pixels."""
MAX_SPEED = 4.0
AXES: Mapping[str, str] = MappingProxyType(
    {"generation": "generation", "evaluations": "progress/evaluations"}
)
"""Axes that fitness can be plotted over, and their columns in the metrics."""


@dataclass(frozen=True)
class FilmOptions:
    """Options of a film.

    Raises:
        VizError: If the height or the speed is out of range.
    """

    episodes: int = 4
    """Number of episodes after growth; the regions of the light or ball take turns."""
    seed: int = 0
    """Seed for sampling the scenarios."""
    speed: float = 0.5
    """Speed as a multiple of real time."""
    height: int = 600
    """Height of the picture in pixels, which is half again as wide."""
    perturbations: PerturbationSettings = NO_PERTURBATIONS
    """What happens to the robot in its episodes."""

    def __post_init__(self) -> None:
        if not MIN_HEIGHT <= self.height <= MAX_HEIGHT:
            raise VizError(
                f"The height must be from {MIN_HEIGHT} to {MAX_HEIGHT} pixels, got {self.height}."
            )
        if not 0.0 < self.speed <= MAX_SPEED:
            raise VizError(
                f"The speed must be above 0 and at most {MAX_SPEED:g}, got {self.speed}."
            )


@dataclass(frozen=True)
class FigureOptions:
    """Options of figures.

    Raises:
        VizError: If the axis is unknown.
    """

    axis: str = "generation"
    """Axis that fitness is plotted over: one of ``AXES``."""
    episodes: int = 12
    """Number of episodes whose last positions are shown."""
    seed: int = 0
    """Seed for sampling the scenarios."""

    def __post_init__(self) -> None:
        if self.axis not in AXES:
            raise VizError(f"The axis must be one of {list(AXES)}, got {self.axis!r}.")
