"""The settings of the optimizers: one record for each, checked where it is made.

A default and its explanation stand at the field; ``python train.py --help`` lists both.
"""

# The records are not frozen: OmegaConf makes frozen dataclasses read-only.

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Any, ClassVar, NamedTuple

from ncrs_envs.checks import check_types
from ncrs_envs.errors import NCRSError

STEP_SIZES = ("csa", "decay", "tpa")
RESTART_FROM = ("best", "elite", "mean")
LINEAR_ALGEBRA = ("pycma", "torch")
PRECISIONS = ("float32", "float64")
RANKINGS = ("fitness", "improvement")


class OptimizerError(NCRSError, ValueError):
    """A setting out of range; or ask, tell and state used out of order."""


@dataclass
class OptimizerSettings:
    """The settings that all optimizers have.

    Raises:
        OptimizerError: If a setting has another type, or is out of range.
    """

    name: str
    """Name of the optimizer; chosen with optimizer=NAME."""
    population: int
    """Genomes per generation; with emitters, those of the emitter whose turn it is."""

    min_population: ClassVar[int] = 1
    may_be_symmetric: ClassVar[bool] = True
    """False if its genomes must not be made symmetric, since they tell left from right."""

    def __post_init__(self) -> None:
        check_types(self, OptimizerError)
        own = self._default("name")
        if self.name != own:
            raise OptimizerError(
                f"The name must be {own!r}, whose settings these are, got {self.name!r}; choose "
                "another optimizer with optimizer=NAME."
            )
        _check_minimum("population", self.population, self.min_population)

    def _default(self, name: str) -> Any:
        return next(item.default for item in fields(self) if item.name == name)

    def _is_changed(self, name: str) -> bool:
        return bool(getattr(self, name) != self._default(name))

    def _refuse_changes(self, names: Iterable[str], reason: str) -> None:
        """Raise ``OptimizerError`` if settings without effect differ from their defaults."""
        changed = [name for name in names if self._is_changed(name)]
        if changed:
            raise OptimizerError(f"{reason}: leave out {', '.join(changed)}.")

    @property
    def maximises_fitness(self) -> bool:
        """True if the optimizer learns from the fitness that it is told, not from the archive."""
        return True


class SigmaSchedule(NamedTuple):
    """A step size that shrinks by a factor per generation until it is at its minimum."""

    decay: float
    minimum: float


@dataclass
class CMASettings(OptimizerSettings):
    """The settings that all optimizers by CMA-ES have."""

    population: int = 112
    sigma: float = 0.03
    """Initial step size; 0.01 in the paper."""
    parents: int | None = None
    """Genomes of a generation that are recombined into the next mean; null for pycma's own number,
    half of the population. 14 in the published runs, which is a higher selection pressure."""
    step_size: str = "csa"
    """Adaptation of sigma: csa, by the length of the search path, as in the paper's time; tpa, at
    two points, newer pycma's choice for many weights; or decay, by a fixed schedule, which neither
    noise nor plateaus can collapse."""
    sigma_decay: float = 0.9975
    """With step_size=decay, sigma's factor per generation."""
    sigma_min: float = 0.0015
    """With step_size=decay, the sigma at which it stops shrinking."""
    device: str = "cpu"
    """Device of the search: cpu; or cuda, for a GPU that torch can use."""

    min_population: ClassVar[int] = 2

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_positive("sigma", self.sigma)
        if self.parents is not None:
            _check_minimum("parents", self.parents, 1)
            if self.parents > self.population:
                raise OptimizerError(
                    f"population {self.population} is smaller than the {self.parents} parents that "
                    "are recombined; enlarge it, or set parents=null for half of it."
                )
        _check_choice("step_size", self.step_size, STEP_SIZES)
        if self.device != "cpu" and self.step_size == "tpa":
            raise OptimizerError(
                f"step_size=tpa is pycma's alone, which runs on the CPU; got device={self.device}: "
                "choose step_size=csa or decay, or device=cpu."
            )
        if self.step_size != "decay":
            reason = f"step_size={self.step_size} has no schedule"
            self._refuse_changes(("sigma_decay", "sigma_min"), reason)
        if not 0.0 < self.sigma_decay <= 1.0:
            raise OptimizerError(f"sigma_decay must lie in (0, 1], got {self.sigma_decay!r}.")
        _check_positive("sigma_min", self.sigma_min)
        if self.sigma_min > self.sigma and self._is_changed("sigma_min"):
            raise OptimizerError(
                f"sigma_min must be positive and at most sigma, {self.sigma!r}, got "
                f"{self.sigma_min!r}."
            )

    @property
    def schedule(self) -> SigmaSchedule | None:
        """The fixed schedule of the step size; None where it adapts."""
        if self.step_size != "decay":
            return None
        return SigmaSchedule(self.sigma_decay, min(self.sigma_min, self.sigma))


@dataclass
class MatrixSettings(OptimizerSettings):
    """The settings of a full covariance."""

    linear_algebra: str = "torch"
    """Library for the full covariance: torch, with Cholesky factors; or pycma, with eigenvectors,
    which take 16 s every 8th generation at 4,572 weights."""
    precision: str = "float32"
    """Precision of torch's matrices: float32 or float64."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_choice("linear_algebra", self.linear_algebra, LINEAR_ALGEBRA)
        _check_choice("precision", self.precision, PRECISIONS)
        if self.linear_algebra == "pycma":
            self._refuse_changes(("precision", "device"), "linear_algebra=pycma has neither")


@dataclass
class SearchSettings(CMASettings):
    """The settings of a single search by CMA-ES."""

    restart_sigma: float | None = None
    """Step size below which the search starts again, with the first sigma and nothing learned; null
    for never."""
    restart_from: str = "mean"
    """Genome at which the search starts again: mean; best, the best so far (a lucky draw where
    every generation has new scenarios); or elite, the best of the archive, whose fitness can be
    estimated again (mean while there is none)."""

    covariance: ClassVar[str]
    """"full", "diagonal" or "none"."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_choice("restart_from", self.restart_from, RESTART_FROM)
        if self.restart_sigma is None:
            return
        _check_positive("restart_sigma", self.restart_sigma)
        if self.restart_sigma >= self.sigma:
            raise OptimizerError(
                f"restart_sigma must be smaller than sigma, {self.sigma!r}, got "
                f"{self.restart_sigma!r}."
            )
        if self.schedule is not None and self.restart_sigma <= self.schedule.minimum:
            raise OptimizerError(
                f"restart_sigma must exceed sigma_min, {self.schedule.minimum!r}, below which the "
                f"schedule never goes; got {self.restart_sigma!r}."
            )


@dataclass
class CMAESSettings(SearchSettings, MatrixSettings):
    """CMA-ES with a full covariance, as in the paper."""

    name: str = "cma_es"
    sigma: float = 0.01

    covariance: ClassVar[str] = "full"


@dataclass
class SepCMAESSettings(SearchSettings):
    """Separable CMA-ES: variances only, in linear memory and with faster learning rates.

    Its larger sigma leaves the first plateau sooner.
    """

    name: str = "sep_cma_es"
    parents: int | None = 14
    step_size: str = "decay"

    covariance: ClassVar[str] = "diagonal"


@dataclass
class IsoCMAESSettings(SepCMAESSettings):
    """CMA-ES with mean and step size only: the control experiment, which learns no covariance."""

    name: str = "iso_cma_es"

    covariance: ClassVar[str] = "none"


@dataclass
class EmitterSettings(CMASettings, MatrixSettings):
    """The settings of emitters that take turns."""

    population: int = 128
    emitters: int = 15
    """Searches by CMA-ES that take turns; 15 in the paper."""
    patience: int = 500
    """Turns in which an emitter adds nothing to the archive (with cma_mae: finds no fitness above a
    threshold) before it restarts from a random elite; 500 in the paper."""
    diagonal: bool = False
    """Learn variances only, which is fast and takes little memory."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_minimum("emitters", self.emitters, 1)
        _check_minimum("patience", self.patience, 1)
        if self.diagonal:
            self._refuse_changes(
                ("linear_algebra", "precision"), "A diagonal covariance has no matrices"
            )

    @property
    def maximises_fitness(self) -> bool:
        """False: the emitters learn from their effect on the archive."""
        return False

    @property
    def emitter(self) -> SearchSettings:
        """The settings of each emitter's search."""
        kind = SepCMAESSettings if self.diagonal else CMAESSettings
        own = {item.name for item in fields(self)} - {"name"}
        shared = {item.name for item in fields(kind)} & own
        return kind(**{name: getattr(self, name) for name in shared})


@dataclass
class CMAMESettings(EmitterSettings):
    """CMA-ME as in the paper; its 15 full covariances take 4.9 GB at 4,572 weights."""

    name: str = "cma_me"
    sigma: float = 0.01
    ranking: str = "improvement"
    """Objective of an emitter: improvement, as the method was published, where genomes that
    filled an empty cell come first, then those that improved one, then the rest, each by
    improvement; or fitness, as in the published runs."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_choice("ranking", self.ranking, RANKINGS)

    @property
    def maximises_fitness(self) -> bool:
        """True if the emitters rank genomes by fitness."""
        return self.ranking == "fitness"


@dataclass
class CMAMAESettings(EmitterSettings):
    """CMA-ME with thresholds that rise slowly."""

    name: str = "cma_mae"
    diagonal: bool = True
    learning_rate: float = 0.01
    """Speed at which the thresholds rise, 0 to 1 (alpha in the source): with 0 this is CMA-ES on
    fitness, with 1 CMA-ME."""
    threshold_min: float = 0.0
    """First threshold of every cell: the minimum fitness worth having."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_fraction("learning_rate", self.learning_rate)
        if not math.isfinite(self.threshold_min):
            raise OptimizerError(f"threshold_min must be finite, got {self.threshold_min!r}.")


@dataclass
class MAPElitesSettings(OptimizerSettings):
    """MAP-Elites: children of random elites, which fill the archive fastest."""

    name: str = "map_elites"
    population: int = 128
    initial_sigma: float = 0.1
    """Standard deviation of the first genomes."""
    initial_genomes: int = 1024
    """Genomes that are drawn before variation begins."""
    iso_sigma: float = 0.01
    """Standard deviation of the noise that the iso+line operator adds to every weight."""
    line_sigma: float = 0.2
    """Standard deviation of its step along the line through two elites, per unit of their
    distance."""
    sparse_fraction: float = 0.5
    """Fraction of the children that the sparse operator makes, 0 to 1; iso+line makes the rest."""
    sparse_sigma_min: float = 0.01
    """Minimum standard deviation of the sparse operator's noise."""
    sparse_sigma_max: float = 1.0
    """Maximum standard deviation of the sparse operator's noise."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_minimum("initial_genomes", self.initial_genomes, 0)
        _check_fraction("sparse_fraction", self.sparse_fraction)
        for name in ("initial_sigma", "iso_sigma", "line_sigma"):
            _check_positive(name, getattr(self, name))
        for name in ("sparse_sigma_min", "sparse_sigma_max"):
            _check_positive(name, getattr(self, name))
        if self.sparse_sigma_min > self.sparse_sigma_max:
            raise OptimizerError(
                f"sparse_sigma_min={self.sparse_sigma_min!r} must not be larger than "
                f"sparse_sigma_max={self.sparse_sigma_max!r}."
            )

    @property
    def maximises_fitness(self) -> bool:
        """False: parents are drawn from the archive, whatever the fitness."""
        return False


@dataclass
class DraftsSettings(OptimizerSettings):
    """Drafts: bodies drawn for every measure triple, with controllers by hand; no evolution."""

    name: str = "drafts"
    population: int = 128
    descent_steps: int = 100
    """Maximum number of steps of gradient descent towards a genome that grows a body."""

    may_be_symmetric: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_minimum("descent_steps", self.descent_steps, 1)

    @property
    def maximises_fitness(self) -> bool:
        """False: nothing is learned from fitness; the archive keeps the best."""
        return False


def _check_minimum(name: str, value: int, minimum: int) -> None:
    if value < minimum:
        raise OptimizerError(f"{name} must be at least {minimum}, got {value!r}.")


def _check_positive(name: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0):
        raise OptimizerError(f"{name} must be positive and finite, got {value!r}.")


def _check_fraction(name: str, value: float) -> None:
    if not 0.0 <= value <= 1.0:
        raise OptimizerError(f"{name} must be from 0 to 1, got {value!r}.")


def _check_choice(name: str, value: str, choices: Iterable[str]) -> None:
    if value not in choices:
        raise OptimizerError(f"{name} must be one of {sorted(choices)}, got {value!r}.")
