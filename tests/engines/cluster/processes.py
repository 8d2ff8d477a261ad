"""A Dask cluster of separate processes on this computer, for tests that harm it."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

from distributed import Client

from ncrs.engines.cluster.dask import address_in

ROOT = Path(__file__).parents[3]


class Zygote:
    """The program that forks; a context manager that ends it."""

    def __init__(self):
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.engines.cluster.zygote"],
            cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip

    def fork(self, **request):
        """Start a process; return its id."""
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        return int(self._process.stdout.readline())

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self._process.kill()
        self._process.communicate()


class Processes:
    """A scheduler and workers, each a process of its own; a context manager that ends them.

    Args:
        zygote: Where they come from.
        folder: Folder for the scheduler file.
    """

    def __init__(self, zygote, folder):
        self._zygote = zygote
        self.scheduler_file = str(folder / "scheduler.json")
        self._started = []
        self.start_scheduler()

    def start_scheduler(self):
        """Start a scheduler, also in place of one that was killed."""
        Path(self.scheduler_file).unlink(missing_ok=True)
        self.scheduler = self._fork(kind="scheduler")
        wait_for(Path(self.scheduler_file).exists)
        address_in(Path(self.scheduler_file), limit_s=60.0)

    def add_worker(self, harm=None):
        """Start a worker; return its process id."""
        return self._fork(kind="worker", harm=harm)

    def wait_for_workers(self, count):
        """Return when the scheduler knows that many workers."""
        with Client(scheduler_file=self.scheduler_file, set_as_default=False) as client:
            client.wait_for_workers(count)
            wait_for(lambda: len(client.nthreads()) == count)

    def _fork(self, **request):
        self._started.append(self._zygote.fork(file=self.scheduler_file, **request))
        return self._started[-1]

    def end(self, process):
        """Kill a process that was started here, unless a test has."""
        if process in self._started:
            self._started.remove(process)
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        for process in list(self._started):
            self.end(process)


def wait_for(condition, seconds=60.0):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited too long"
        time.sleep(0.02)
