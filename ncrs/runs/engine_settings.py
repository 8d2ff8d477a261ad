"""The settings of the engine of a run, and the error of all settings."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

from ncrs.engines.base import AUDIT_SHARE, AUTO_ENGINE, REFUSE, check_workers, resolve_engine
from ncrs_envs.checks import check_types
from ncrs_envs.errors import NCRSError


class ConfigError(NCRSError, ValueError):
    """A setting that is unknown or out of range."""


# The records are not frozen: OmegaConf makes frozen dataclasses read-only.
@dataclass
class EngineSettings:
    """The engine that evaluates the populations.

    Raises:
        ConfigError: If a setting has another type.
        EngineSettingError: If there is no such engine, or ``workers`` is not positive.
    """

    name: str = AUTO_ENGINE
    """Name of the engine, chosen with engine=NAME: batched, a whole population in one compiled
    call; cuda, the same on GPUs; box2d, the reference physics; dask, the workers of a Dask cluster;
    futures, those of any concurrent.futures executor; or auto, the fastest that works here."""
    workers: int | None = None
    """Number of threads (batched) or processes (box2d, futures, and dask without a scheduler),
    which does not change results; null for one per core."""
    devices: list[int] | None = None
    """Indices of the GPUs that the engine cuda spreads genomes over, which does not change results;
    null for the first."""
    scheduler: str | None = None
    """Scheduler of the engine dask: tcp://HOST:PORT, or the path of a scheduler file; null for the
    one that Dask is configured for (DASK_SCHEDULER_ADDRESS), else for workers on this computer."""
    executor: str | None = None
    """Executor of the engine futures, as MODULE:NAME of a class or function that takes max_workers,
    such as mpi4py.futures:MPIPoolExecutor; null for processes of this computer."""
    threads: int | None = None
    """Threads of each worker of dask or futures; null for as many as Dask gave it, one in
    futures."""
    on_workers: str = AUTO_ENGINE
    """Engine that the workers of dask and futures use: batched, cuda or box2d; or auto, as above,
    for each of them."""
    audit: float = AUDIT_SHARE
    """Share of each generation, one genome at least, that dask and futures evaluate on a second
    worker to compare the results; 0 for none."""
    other_versions: str = REFUSE
    """Reaction of dask and futures to a worker with other versions of ncrs, numba or numpy: refuse,
    or warn."""

    def __post_init__(self) -> None:
        check_types(self, ConfigError)
        if self.name != AUTO_ENGINE:  # which is resolved only where it is used
            resolve_engine(self.name)
        check_workers(self.workers)

    def own(self) -> dict[str, Any]:
        """Return the settings that only some engines use, where they are not the default."""
        return {
            item.name: getattr(self, item.name)
            for item in fields(self)
            if item.name not in ("name", "workers") and getattr(self, item.name) != item.default
        }
