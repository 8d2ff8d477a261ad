"""Interface of the engines: arguments, checked here, and results."""

from __future__ import annotations

import ctypes
import importlib
import importlib.util
import sys
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from types import TracebackType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import NCALayout
from ncrs.engines.arguments import (
    GivenBodies,
    ScenarioRows,
    check_given_bodies,
    check_scenario_rows,
)
from ncrs_envs.body import body_measures
from ncrs_envs.cores import available_cores
from ncrs_envs.errors import NCRSError
from ncrs_envs.notices import notice
from ncrs_envs.registry import Registry
from ncrs_envs.scenario import Scenario
from ncrs_envs.tasks import MAX_EPISODE_STEPS, TaskSettings

StopCheck = Callable[[], bool]

INVALID_MEASURES = -1
"""Value of all measures of a body that is not valid."""


class EngineError(NCRSError, RuntimeError):
    """An evaluation that could not be finished; the message names the genome."""


class EngineSettingError(NCRSError, ValueError):
    """An unknown engine, or an invalid number of workers."""


class EvaluationInterrupted(Exception):
    """A request to stop during an evaluation."""


class NonFiniteStateWarning(RuntimeWarning):
    """A genome with a fitness of NaN, because its automaton's state became non-finite."""


@dataclass(frozen=True)
class Evaluation:
    """Results for P genomes in E episodes each, on an n x n grid."""

    fitness: NDArray[np.float64]
    """Mean fitness of the episodes, ``(P,)``; NaN if the automaton's state became non-finite."""
    episode_fitness: NDArray[np.float64]
    """Mean reward over the steps of each episode, ``(P, E)``; partial credit for invalid bodies."""
    success: NDArray[np.bool_]
    """True if the episode was a success, ``(P, E)``."""
    crossed: NDArray[np.bool_]
    """True if the robot's centre was ever above y = 0, ``(P, E)``; False outside Obstacle."""
    closest: NDArray[np.float64]
    """Closest approach of each episode, ``(P, E, D)``, in units: robot to light, D = 1; or in
    CarryBall robot to ball and ball to target, D = 2. Infinite for invalid bodies."""
    bodies: NDArray[np.int8]
    """Cell codes, ``(P, n, n)``."""
    valid: NDArray[np.bool_]
    """True if the body is valid, ``(P,)``."""
    measures: NDArray[np.int64]
    """Numbers of sensors, wheels and cells, ``(P, 3)``; -1 for invalid bodies."""
    recovered: NDArray[np.float64]
    """Fraction of the lost modules that are back at the end, ``(P, E)``; 1 if none was lost."""

    @property
    def env_steps(self) -> int:
        """Number of env steps simulated; invalid bodies take none."""
        return int(self.valid.sum() * self.episode_fitness.shape[1] * MAX_EPISODE_STEPS)


@dataclass(frozen=True)
class RolloutResult:
    """Result of an engine; the rest of an ``Evaluation`` follows from it.

    Shapes as in ``Evaluation``; rows of invalid bodies are ignored.
    """

    bodies: NDArray[np.int8]
    episode_fitness: NDArray[np.float64]
    success: NDArray[np.bool_]
    crossed: NDArray[np.bool_]
    closest: NDArray[np.float64]
    grown: NDArray[np.bool_] | None = None
    """False if the automaton's state became non-finite during growth, ``(P,)``; None where that is
    not recorded."""
    recovered: NDArray[np.float64] | None = None
    """None without perturbations."""


class Engine(ABC):
    """Evaluator of populations; a context manager that releases its workers.

    Args:
        settings: Task and its settings.
        workers: Number of processes or threads; None for one per core that this process may use.
            Results do not depend on it.
    """

    name: ClassVar[str]

    def __init__(self, settings: TaskSettings, workers: int | None = None) -> None:
        self.settings = settings
        self.layout = NCALayout(settings.task)
        self.workers = check_workers(workers)

    def evaluate(
        self,
        genomes: Any,
        scenarios: Sequence[Scenario] | ScenarioRows,
        should_stop: StopCheck | None = None,
        bodies: Any = None,
    ) -> Evaluation:
        """Grow each genome's robot and drive it through its scenarios.

        Args:
            genomes: Finite real numbers, shape ``(P, num_parameters)``.
            scenarios: One row of E scenarios for all genomes, or P rows of E.
            should_stop: Function that is polled now and then; True ends the evaluation.
            bodies: Bodies to drive instead of grown ones: a valid body for all genomes, or one for
                each, in any form that ``parse_body`` reads.

        Raises:
            GenomeError: The genomes have the wrong shape, or values that are not finite.
            BodyError: A given body is malformed, or the task cannot use it.
            ScenarioError: There are no scenarios, their rows differ in length, or one does not
                fit the task.
            EngineError: A worker was lost.
            EvaluationInterrupted: ``should_stop`` returned True.
        """
        return self._evaluation(self.roll_out(genomes, scenarios, should_stop, bodies))

    def roll_out(
        self,
        genomes: Any,
        scenarios: Sequence[Scenario] | ScenarioRows,
        should_stop: StopCheck | None = None,
        bodies: Any = None,
    ) -> RolloutResult:
        """Return what ``evaluate`` makes its results from; arguments and errors are the same."""
        checked = self._check_genomes(genomes)
        rows = check_scenario_rows(scenarios, self.settings, len(checked))
        given = check_given_bodies(bodies, self.settings, len(checked))
        return self._rollout(checked, rows, should_stop or (lambda: False), given)

    def _check_genomes(self, genomes: Any) -> Any:
        """Return genomes as ``_rollout`` takes them, or raise ``GenomeError``."""
        return self.layout.check_genomes(genomes)

    def metrics(self) -> dict[str, float]:
        """Return the values of this engine's own curves; none for most engines."""
        return {}

    @abstractmethod
    def _rollout(
        self,
        genomes: NDArray[np.float32],
        rows: ScenarioRows,
        should_stop: StopCheck,
        bodies: GivenBodies,
    ) -> RolloutResult:
        """Roll out checked genomes; ``rows`` has one row, or one per genome."""

    def _evaluation(self, result: RolloutResult) -> Evaluation:
        task = self.settings.task
        valid = task.is_valid(result.bodies)
        credit = task.partial_credit(result.bodies)[:, None]
        episode_fitness = np.where(valid[:, None], result.episode_fitness, credit)
        for genome in [] if result.grown is None else np.flatnonzero(~result.grown):
            warnings.warn(
                f"The NCA's state of genome {genome} turned non-finite during growth; it has no "
                "body. Its weights are too large.",
                NonFiniteStateWarning,
                stacklevel=3,
            )
        for genome, episode in np.argwhere(~np.isfinite(episode_fitness)):
            warnings.warn(
                f"The NCA's state of genome {genome} became non-finite in episode {episode}; its "
                "fitness is NaN. Its weights are too large.",
                NonFiniteStateWarning,
                stacklevel=3,
            )
        back = 1.0 if result.recovered is None else result.recovered
        measures = np.where(valid[:, None], body_measures(result.bodies), INVALID_MEASURES)
        return Evaluation(
            fitness=episode_fitness.mean(axis=1),
            episode_fitness=episode_fitness,
            success=result.success & valid[:, None],
            crossed=result.crossed & valid[:, None] & task.has_walls,
            closest=np.where(valid[:, None, None], result.closest, np.inf),
            bodies=result.bodies,
            valid=valid,
            measures=measures,
            recovered=np.where(valid[:, None], back, np.ones(result.success.shape)),
        )

    def close(self) -> None:  # noqa: B027 - most engines hold nothing
        """Release workers; a further evaluation starts new ones."""

    def __enter__(self) -> Engine:
        return self

    def __exit__(
        self,
        exception_type: type[BaseException] | None,
        exception: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


def check_workers(workers: Any) -> int:
    """Return the number of workers, one per core for None.

    Raises:
        EngineSettingError: ``workers`` is neither None nor a positive integer.
    """
    if workers is None:
        return available_cores()
    if isinstance(workers, bool) or not isinstance(workers, int | np.integer) or workers < 1:
        raise EngineSettingError(f"workers must be a positive integer or None, got {workers!r}.")
    return int(workers)


CUDA_ENGINE = "cuda"
"""Name of the engine on GPUs."""
DASK_ENGINE, FUTURES_ENGINE = "dask", "futures"
CLUSTER_ENGINES = (DASK_ENGINE, FUTURES_ENGINE)
"""Names of the engines that hand shards of a population to workers with engines of their own."""

# Classes, or module and class: imported on use, since each needs its own heavy packages.
ENGINES: Registry[str | type[Engine]] = Registry(
    "engine",
    {
        "batched": "ncrs.engines.batched:BatchedEngine",
        "box2d": "ncrs.engines.box2d:Box2DEngine",
        CUDA_ENGINE: "ncrs.engines.cuda.engine:CUDAEngine",
        DASK_ENGINE: "ncrs.engines.cluster.dask:DaskEngine",
        FUTURES_ENGINE: "ncrs.engines.cluster.futures:FuturesEngine",
    },
)

_NEEDED = {
    CUDA_ENGINE: ("numba_cuda", "numba-cuda", "cuda"),
    DASK_ENGINE: ("distributed", "distributed", "cluster"),
}
"""Module, package and extra that an engine needs."""

AUDIT_SHARE = 0.01
"""Share of a population that those engines evaluate on a second worker by default."""
REFUSE, WARN = "refuse", "warn"
"""Their reactions to a worker with other versions."""

_OWN_SETTINGS = {
    "devices": ("names GPUs", (CUDA_ENGINE,)),
    "scheduler": ("names a Dask cluster", (DASK_ENGINE,)),
    "executor": ("names an executor", (FUTURES_ENGINE,)),
    "threads": ("is the number of threads of a worker", CLUSTER_ENGINES),
    "on_workers": ("is an engine for workers", CLUSTER_ENGINES),
    "audit": ("is a share to evaluate twice", CLUSTER_ENGINES),
    "other_versions": ("is about versions on workers", CLUSTER_ENGINES),
}
"""Settings that only some engines use: meaning, and these engines."""


def register_engine(engine: type[Engine]) -> None:
    """Make an engine known by its ``name``; raise ``ExtensionError`` if that is taken."""
    ENGINES.register(engine.name, engine)


AUTO_ENGINE = "auto"
"""Name for the best engine that works here: ``cuda`` where there is a GPU and the package that it
needs, else ``batched``; ``box2d`` for tasks and settings that need it."""


def resolve_engine(name: str, settings: TaskSettings | None = None, perturbed: bool = False) -> str:
    """Resolve the name of an engine, for a task and its settings if they are known.

    Args:
        name: Name of an engine, or "auto".
        settings: Task and its settings.
        perturbed: True if something happens to the robots, which GPUs do not simulate.

    Raises:
        EngineSettingError: If there is no such engine.
    """
    if name == AUTO_ENGINE:
        if settings is not None and settings.needs_box2d:
            return "box2d"
        return CUDA_ENGINE if not perturbed and has_gpu() else "batched"
    if name not in ENGINES:
        raise EngineSettingError(
            f"Unknown engine {name!r}; choose one of {sorted([AUTO_ENGINE, *ENGINES])}."
        )
    return name


@cache
def has_gpu() -> bool:
    """Return True if the package that the cuda engine needs is here, and a GPU that it can use.

    A process that finds one says so in a line, once.
    """
    if importlib.util.find_spec("numba_cuda") is None or not _has_driver():
        return False
    from ncrs.engines.cuda.devices import check_devices
    from ncrs_envs.cuda.devices import device_name

    try:
        check_devices([0])
    except EngineSettingError:
        return False
    notice(f"engine=auto uses the GPU ({device_name(0)}); engine=batched uses the CPU")
    return True


def usable_engines() -> list[str]:
    """Return the names of the engines that compute in this process and can run here, in order."""
    own = set(ENGINES) - {*CLUSTER_ENGINES}
    return sorted(name for name in own if name != CUDA_ENGINE or has_gpu())


def _has_driver() -> bool:
    """Return True if a driver for NVIDIA GPUs is installed; asking numba-cuda takes a second."""
    name = "nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1"
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True


def _check_installed(name: str, module: str, package: str, extra: str) -> None:
    if importlib.util.find_spec(module) is None:
        raise EngineSettingError(
            f"engine={name} needs the package {package}, which is not installed; install it with: "
            f"pip install 'ncrs[{extra}]'"
        )


def make_engine(
    name: str, settings: TaskSettings, workers: int | None = None, **own: Any
) -> Engine:
    """Make the engine of that name.

    Args:
        name: Name of the engine, or "auto".
        settings: Task and its settings.
        workers: Number of processes or threads; None for one per core.
        **own: Settings that only this engine uses, see ``ncrs.runs.settings.EngineSettings``.

    Raises:
        EngineSettingError: The engine is unknown, its package is not installed, a setting is
            another engine's, or a GPU or a cluster cannot be used.
    """
    resolved = resolve_engine(name, settings)
    if resolved in _NEEDED:
        _check_installed(resolved, *_NEEDED[resolved])
    for setting in own:
        meaning, owners = _OWN_SETTINGS[setting]
        if resolved not in owners:
            raise EngineSettingError(
                f"engine.{setting} {meaning}, which the engine {resolved} does not use; leave it "
                f"out, or choose engine={' or '.join(owners)}."
            )
    engine = ENGINES[resolved]
    if isinstance(engine, str):
        home, _, attribute = engine.partition(":")
        engine = getattr(importlib.import_module(home), attribute)
    made: Engine = engine(settings, workers, **own)
    return made
