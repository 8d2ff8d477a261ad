"""Pool of worker processes that are never orphaned; losing one is an error that names the job.

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
from collections.abc import Callable, Sequence
from typing import Any, BinaryIO

from ncrs.engines.base import EngineError, EvaluationInterrupted, StopCheck

_HEADER = struct.Struct("!Q")
_POLL_S = 0.1
_JOIN_S = 5.0
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


class _Worker:
    def __init__(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", _BOOTSTRAP, json.dumps(sys.path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **_ONE_THREAD},
        )

    def call(self, function: Callable[[Any], Any], argument: Any) -> tuple[bool, Any]:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        _send(self.process.stdin, (function, argument))  # type: ignore[arg-type]
        succeeded, value = _receive(self.process.stdout)  # type: ignore[arg-type]
        return succeeded, value

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
    ) -> list[Any]:
        """Apply a picklable function to each argument, in any order on any worker.

        Args:
            function: Module-level function.
            arguments: Argument of each job.
            names: Name of each job in error messages.
            should_stop: Function that is polled while waiting; True ends the work.

        Raises:
            EngineError: A worker was lost, or a job raised an error; the message names the job.
            EvaluationInterrupted: ``should_stop`` returned True.
        """
        while len(self._workers) < self._size:
            self._workers.append(_Worker())
        jobs: queue.SimpleQueue[int] = queue.SimpleQueue()
        for index in range(len(arguments)):
            jobs.put(index)
        done: queue.SimpleQueue[tuple[int, bool, Any]] = queue.SimpleQueue()

        def drive(worker: _Worker) -> None:
            while True:
                try:
                    index = jobs.get_nowait()
                except queue.Empty:
                    return
                try:
                    succeeded, value = worker.call(function, arguments[index])
                except (EOFError, OSError, ValueError):
                    # ValueError: the pool is closing and has closed the streams.
                    message = f"Worker process {worker.process.pid} {worker.describe_end()}"
                    done.put((index, False, EngineError(message)))
                    return
                done.put((index, succeeded, value))

        for worker in self._workers:
            threading.Thread(target=drive, args=(worker,), daemon=True).start()
        results: list[Any] = [None] * len(arguments)
        try:
            for _ in arguments:
                index, succeeded, value = self._next(done, should_stop)
                if not succeeded:
                    raise EngineError(f"{value} while evaluating {names[index]}.") from value
                results[index] = value
        except BaseException:
            self.close()
            raise
        return results

    @staticmethod
    def _next(
        done: queue.SimpleQueue[tuple[int, bool, Any]], should_stop: StopCheck
    ) -> tuple[int, bool, Any]:
        while True:
            if should_stop():
                raise EvaluationInterrupted
            try:
                return done.get(timeout=_POLL_S)
            except queue.Empty:
                continue

    def close(self) -> None:
        """End all workers at once."""
        workers, self._workers = self._workers, []
        for worker in workers:
            worker.stop()
