"""A Dask cluster of processes on this computer, which end with it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile

from distributed import LocalCluster

_DEATH_S = 30
"""Time after which a worker without a scheduler ends."""
_END_S = 5.0
_LOCALHOST = "127.0.0.1"


class LocalWorkers:
    """A scheduler in this process, and worker processes that are started again if they end.

    Workers are new interpreters that do not import the caller's main module, so scripts and
    notebooks need no ``if __name__ == "__main__"`` guard.

    Args:
        workers: Number of worker processes.
        threads: Threads of each.
    """

    def __init__(self, workers: int, threads: int) -> None:
        self._scheduler = LocalCluster(
            n_workers=0,
            host=_LOCALHOST,
            protocol="tcp://",
            scheduler_port=0,
            dashboard_address=f"{_LOCALHOST}:0",
            scheduler_kwargs={"dashboard": False},
        )
        self._folder = tempfile.TemporaryDirectory(prefix="ncrs-", ignore_cleanup_errors=True)
        path = os.pathsep.join(filter(None, sys.path))
        self._processes = [
            subprocess.Popen(
                worker_command(self.address, threads, self._folder.name),
                env={**os.environ, "PYTHONPATH": path},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,  # Ctrl-C is the caller's
            )
            for _ in range(workers)
        ]

    @property
    def address(self) -> str:
        """Address of the scheduler."""
        return str(self._scheduler.scheduler_address)

    def close(self) -> None:
        """End the workers, then the scheduler."""
        for process in self._processes:
            process.terminate()
        for process in self._processes:
            try:
                process.wait(_END_S)
            except subprocess.TimeoutExpired:
                _kill_group(process)
        self._scheduler.close()
        self._folder.cleanup()


def _kill_group(process: subprocess.Popen[bytes]) -> None:
    """Kill a process and those that it has started, which may be stopped."""
    if hasattr(os, "killpg"):
        os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
    process.wait()


def worker_command(address: str, threads: int, folder: str) -> list[str]:
    """Return the command that starts a worker of a scheduler.

    Args:
        address: Address of the scheduler.
        threads: Number of threads.
        folder: Folder for the worker's own files.
    """
    return [
        *(sys.executable, "-m", "distributed.cli.dask_worker", address),
        *("--host", _LOCALHOST, "--nthreads", str(threads), "--no-dashboard"),
        *("--memory-limit", "0", "--death-timeout", str(_DEATH_S), "--local-directory", folder),
    ]
