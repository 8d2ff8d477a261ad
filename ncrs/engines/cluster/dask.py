"""Engine on a Dask cluster."""

from __future__ import annotations

import json
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import dask
from distributed import Client

from ncrs.engines.base import DASK_ENGINE, EngineSettingError
from ncrs.engines.cluster.crew import Crew
from ncrs.engines.cluster.dask_crew import DaskCrew
from ncrs.engines.cluster.local import LocalWorkers
from ncrs.engines.cluster.sharded import ShardedEngine, WorkerOptions
from ncrs_envs.tasks import TaskSettings

_CONNECT_S = 30
_WRITE_S = 5.0
_POLL_S = 0.05


class DaskEngine(ShardedEngine):
    """``Engine`` on the workers of a Dask cluster.

    Args:
        settings: Task and its settings.
        workers: Number of processes to start on this computer if there is no cluster; None for one
            per core.
        scheduler: Address of the cluster's scheduler, or path of a scheduler file; None for the one
            that Dask is configured for, else for workers on this computer.
        **options: Fields of ``WorkerOptions``.

    Raises:
        EngineSettingError: No scheduler or worker answers, a worker must not take part, or an
            option is out of range.
    """

    name = DASK_ENGINE

    def __init__(
        self,
        settings: TaskSettings,
        workers: int | None = None,
        scheduler: str | None = None,
        **options: Any,
    ) -> None:
        super().__init__(settings, workers, WorkerOptions(**options))
        self._scheduler = scheduler or dask.config.get("scheduler-address", None)
        self._local: LocalWorkers | None = None
        _ = self.crew  # before anything is spent: is everybody there, and of the same version?

    def _make_crew(self) -> Crew:
        address, least = self._scheduler, 1
        if address is None:
            self._local = LocalWorkers(self.workers, self.setup.threads or 1)
            address, least = self._local.address, self.workers
        try:
            return DaskCrew(_client(address), self.setup, self.admission, least)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Leave the cluster; end workers that this engine has started."""
        super().close()
        local, self._local = self._local, None
        if local is not None:
            local.close()


def _client(scheduler: str) -> Client:
    """Connect to a scheduler."""
    is_file = "://" not in scheduler and Path(scheduler).is_file()
    try:
        address = address_in(Path(scheduler)) if is_file else scheduler
        return Client(address, timeout=_CONNECT_S, set_as_default=False, name="ncrs")
    except (OSError, ValueError) as error:
        raise EngineSettingError(
            f"No Dask scheduler answers at {scheduler} ({error}). engine.scheduler must be an "
            "address such as tcp://HOST:8786, or the path of a file that dask scheduler "
            "--scheduler-file has written."
        ) from error


def address_in(file: Path, limit_s: float = _WRITE_S) -> str:
    """Read the scheduler's address from a scheduler file, which may just be being written.

    Args:
        file: Path of the file.
        limit_s: Time to wait for a whole file, in seconds.

    Raises:
        ValueError: The file holds no address.
        OSError: The file cannot be read.
    """
    deadline = monotonic() + limit_s
    while True:
        try:
            return str(json.loads(file.read_text(encoding="utf-8"))["address"])
        except (ValueError, KeyError, TypeError) as error:
            if monotonic() > deadline:
                raise ValueError(f"{file.name} holds no address of a scheduler") from error
            sleep(_POLL_S)
