"""Pool of worker processes that are never orphaned; losing one is an error that names the job.

A worker that stops answering is replaced, and its job done once more.

Workers are new interpreters that communicate over standard input and output. Unlike those of
``multiprocessing`` they do not import the caller's main module, so scripts and notebooks need no
``if __name__ == "__main__"`` guard. If the parent ends, a worker reads end-of-file and exits.
"""

from __future__ import annotations

import json
import os
import pickle
import queue
import signal
import struct
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable, Sequence
from time import monotonic
from typing import Any, BinaryIO

from ncrs.engines.base import EngineError, EvaluationInterrupted, StopCheck

_HEADER = struct.Struct("!Q")
_POLL_S = 0.1
_JOIN_S = 5.0
_LEAP_S = 1.0
"""Longest time between two polls that counts: more has passed if this process was stopped, too."""
_PATIENCE = 30
"""A job may take this many times as long as the longest before it."""
_LEAST_LIMIT_S = 30.0
_BOOTSTRAP = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from ncrs.engines.pool import serve; serve()"
)
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")


def _send(stream: BinaryIO, message: Any) -> None:
    data = pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL)
    stream.write(_HEADER.pack(len(data)) + data)
    stream.flush()


def _receive(stream: BinaryIO) -> Any:
    header = stream.read(_HEADER.size)
    if len(header) < _HEADER.size:
        raise EOFError
    (length,) = _HEADER.unpack(header)
    data = stream.read(length)
    if len(data) < length:
        raise EOFError
    return pickle.loads(data)


def serve() -> None:
    """Run a worker: apply functions to arguments until end-of-file."""
    signal.signal(
        signal.SIGINT, signal.SIG_IGN
    )  # Ctrl-C reaches the whole group; the parent handles it
    replies = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    # The output of libraries must not mix with the replies.
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    requests = sys.stdin.buffer
    while True:
        try:
            function, argument = _receive(requests)
        except EOFError:
            return
        try:
            reply = (True, function(argument))
        except Exception as error:
            reply = (False, error)
        try:
            _send(replies, reply)
        except BrokenPipeError:
            return


class WorkerWarning(RuntimeWarning):
    """A worker that stopped answering, or that differs from others; the evaluation went on."""


class _Late(Exception):
    """A worker was ended since it did not answer in time."""


class _Worker:
    def __init__(self) -> None:
        self.waited: float | None = None
        """Time since its present job began, in seconds; None without a job."""
        self.is_late = False
        self.process = subprocess.Popen(
            [sys.executable, "-c", _BOOTSTRAP, json.dumps(sys.path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **_ONE_THREAD},
        )

    def call(self, function: Callable[[Any], Any], argument: Any) -> tuple[bool, Any]:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.waited = 0.0
        try:
            _send(self.process.stdin, (function, argument))  # type: ignore[arg-type]
            succeeded, value = _receive(self.process.stdout)  # type: ignore[arg-type]
        finally:
            self.waited = None
        return succeeded, value

    def end_if_late(self, passed: float, limit_s: float) -> None:
        """Count the time that has passed; end the process if its job takes too long."""
        if self.waited is not None:
            self.waited += passed
            if self.waited > limit_s:
                self.is_late = True
                self.process.kill()

    def describe_end(self) -> str:
        try:
            code = self.process.wait(_JOIN_S)
        except subprocess.TimeoutExpired:
            return "stopped answering"
        if code < 0:
            return f"was killed by {signal.Signals(-code).name}"
        return f"ended with exit code {code}"

    def stop(self) -> None:
        self.process.kill()
        self.process.wait()
        for stream in (self.process.stdin, self.process.stdout):
            if stream is not None:
                try:
                    stream.close()
                except BrokenPipeError:
                    continue  # buffered data has no reader any more


class _Map:
    """The jobs of one call of ``WorkerPool.map``, and what has become of them."""

    def __init__(
        self, function: Callable[[Any], Any], arguments: Sequence[Any], limit_s: float | None
    ) -> None:
        self._function = function
        self._arguments = arguments
        self._limit_s = limit_s
        self._longest = 0.0
        self._jobs: queue.SimpleQueue[int] = queue.SimpleQueue()
        self._done: queue.SimpleQueue[tuple[int, bool, Any]] = queue.SimpleQueue()
        for index in range(len(arguments)):
            self.put(index)

    def put(self, index: int) -> None:
        """Add a job."""
        self._jobs.put(index)

    def start(self, worker: _Worker) -> None:
        """Let a worker take jobs until there are none."""
        threading.Thread(target=self._drive, args=(worker,), daemon=True).start()

    def _drive(self, worker: _Worker) -> None:
        while True:
            try:
                index = self._jobs.get_nowait()
            except queue.Empty:
                return
            began = monotonic()
            try:
                succeeded, value = worker.call(self._function, self._arguments[index])
            except (EOFError, OSError, ValueError):
                # ValueError: the pool is closing and has closed the streams.
                name = f"Worker process {worker.process.pid}"
                error = (
                    _Late(f"{name}, the second to try, did not answer in time")
                    if worker.is_late
                    else EngineError(f"{name} {worker.describe_end()}")
                )
                self._done.put((index, False, error))
                return
            self._longest = max(self._longest, monotonic() - began)
            self._done.put((index, succeeded, value))

    @property
    def limit_s(self) -> float:
        """Seconds that a job may take now."""
        if self._limit_s is None:
            return float("inf")
        if not self._longest:
            return self._limit_s
        return min(self._limit_s, max(_LEAST_LIMIT_S, _PATIENCE * self._longest))

    def next(self, workers: Sequence[_Worker], should_stop: StopCheck) -> tuple[int, bool, Any]:
        """Wait for the next result: a job's index, whether it succeeded, and value or error.

        Raises:
            EvaluationInterrupted: ``should_stop`` returned True.
        """
        before = monotonic()
        while True:
            if should_stop():
                raise EvaluationInterrupted
            try:
                return self._done.get(timeout=_POLL_S)
            except queue.Empty:
                now = monotonic()
            for worker in workers:
                worker.end_if_late(min(now - before, _LEAP_S), self.limit_s)
            before = now


class WorkerPool:
    """A fixed number of worker processes, started on first use."""

    def __init__(self, workers: int) -> None:
        self._size = workers
        self._workers: list[_Worker] = []

    @property
    def pids(self) -> list[int]:
        """Process ids of the running workers."""
        return [worker.process.pid for worker in self._workers]

    def map(
        self,
        function: Callable[[Any], Any],
        arguments: Sequence[Any],
        names: Sequence[str],
        should_stop: StopCheck,
        limit_s: float | None = None,
    ) -> list[Any]:
        """Apply a picklable function to each argument, in any order on any worker.

        Args:
            function: Module-level function.
            arguments: Argument of each job.
            names: Name of each job in error messages.
            should_stop: Function that is polled while waiting; True ends the work.
            limit_s: Seconds after which the worker of a job counts as stopped; None for never.
                Once jobs have ended, the longest of them says what to expect.

        Warns:
            WorkerWarning: A worker stopped answering; it is replaced, and its job done again.

        Raises:
            EngineError: A worker was lost, a job raised an error, or twice there was no answer; the
                message names the job.
            EvaluationInterrupted: ``should_stop`` returned True.
        """
        while len(self._workers) < self._size:
            self._workers.append(_Worker())
        jobs = _Map(function, arguments, limit_s)
        for worker in self._workers:
            jobs.start(worker)
        results: list[Any] = [None] * len(arguments)
        missing, repeated = set(range(len(arguments))), set()
        try:
            while missing:
                index, succeeded, value = jobs.next(self._workers, should_stop)
                if isinstance(value, _Late) and index not in repeated:
                    repeated.add(index)
                    warnings.warn(
                        f"A worker process did not answer for {jobs.limit_s:.0f} s while "
                        f"evaluating {names[index]}; another one does it again.",
                        WorkerWarning,
                        stacklevel=2,
                    )
                    jobs.put(index)
                    jobs.start(self._replace())
                elif not succeeded:
                    raise EngineError(f"{value} while evaluating {names[index]}.") from value
                else:
                    results[index] = value
                    missing.remove(index)
        except BaseException:
            self.close()
            raise
        return results

    def _replace(self) -> _Worker:
        """Start a worker in place of one that was ended."""
        place = next(i for i, worker in enumerate(self._workers) if worker.is_late)
        self._workers[place].stop()
        self._workers[place] = _Worker()
        return self._workers[place]

    def close(self) -> None:
        """End all workers at once."""
        workers, self._workers = self._workers, []
        for worker in workers:
            worker.stop()
