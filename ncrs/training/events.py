"""The event file of a run: after a kill it keeps each step of each tag once, in order."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from tensorboard.backend.event_processing.event_file_loader import RawEventFileLoader
from tensorboard.compat.proto.event_pb2 import Event
from tensorboard.summary.writer.record_writer import RecordWriter
from torch.utils.tensorboard import FileWriter, SummaryWriter

from ncrs.runs.checkpoint import write_atomically

_PATTERN = "events.out.tfevents.*"
_VERSION = "brain.Event:2"
_FLUSH_SECONDS = 10.0
KEPT_FILE = "events.out.tfevents.0000000000.kept"
"""Name of the file with the events of earlier sessions; TensorBoard reads files by name."""


def event_files(run_dir: Path) -> list[Path]:
    """List the event files of a run, in the order in which TensorBoard reads them."""
    return sorted(run_dir.glob(_PATTERN))


def keep_events(run_dir: Path, start: int) -> None:
    """Gather the events before a generation in one file, and remove the other event files.

    TensorBoard's own purging goes by the order of files, which follows the clock, and by steps; it
    cannot purge generation 0.

    Args:
        run_dir: Folder of the run.
        start: Index of the first generation to come; events from there on are dropped, and a run
            that starts at 0 keeps none.

    Raises:
        CheckpointError: If the files cannot be written.
    """
    kept = run_dir / KEPT_FILE
    others = [path for path in event_files(run_dir) if path != kept]
    if not others and start:
        return
    events = list(_events([kept, *others])) if start else []
    # A later event of the same tags and step repeats an earlier one.
    last = {(event.step, _tags(event)): index for index, event in enumerate(events)}
    chosen = [
        events[index]
        for (step, tags), index in sorted(last.items(), key=lambda item: (item[0][0], item[1]))
        if step < start and tags
    ]
    if chosen:
        version = Event(file_version=_VERSION, wall_time=chosen[0].wall_time)
        records = [event.SerializeToString() for event in (version, *chosen)]

        def write(stream: object) -> None:
            writer = RecordWriter(stream)
            for record in records:
                writer.write(record)

        write_atomically(kept, write)
    else:
        others.append(kept)
    for path in others:
        if path.exists():
            os.unlink(path)


def _events(paths: list[Path]) -> Iterator[Event]:
    for path in paths:
        if path.is_file():
            for record in RawEventFileLoader(str(path)).Load():
                yield Event.FromString(record)


def _tags(event: Event) -> tuple[str, ...]:
    return tuple(value.tag for value in event.summary.value)


class RunWriter(SummaryWriter):
    """TensorBoard's writer of a run's events, without its thread: errors are the caller's.

    The thread of TensorBoard's own writer prints a traceback when the disk is full.

    Args:
        run_dir: Folder of the run.
        clock: Function that returns seconds since any fixed time; what is written can be read after
            ten seconds, or after ``flush``.

    Raises:
        OSError: If the file cannot be written; from every method that adds, flushes or closes.
    """

    def __init__(self, run_dir: Path, clock: Callable[[], float] = time.monotonic) -> None:
        self._file: FileWriter | None = _FileWriter(run_dir, clock)
        super().__init__(str(run_dir))

    def _get_file_writer(self) -> FileWriter:
        if self._file is None:
            raise ValueError("The writer of events is closed.")
        return self._file

    def flush(self) -> None:
        """Let readers see what was added."""
        self._get_file_writer().flush()

    def close(self) -> None:
        """Write what was added, and close the file; a second call does nothing."""
        file, self._file = self._file, None
        if file is not None:
            file.close()


class _FileWriter(FileWriter):
    def __init__(self, run_dir: Path, clock: Callable[[], float]) -> None:
        self.event_writer = _EventFile(run_dir, clock)


class _EventFile:
    """What ``FileWriter`` needs of TensorBoard's ``EventFileWriter``."""

    def __init__(self, run_dir: Path, clock: Callable[[], float]) -> None:
        self._run_dir, self._clock = run_dir, clock
        name = _PATTERN.replace(
            "*", f"{int(time.time()):010d}.{socket.gethostname()}.{os.getpid()}"
        )
        self._stream = open(run_dir / name, "wb")  # noqa: SIM115, ``close`` closes it
        self._records = RecordWriter(self._stream)
        self._flushed = clock()
        self.add_event(Event(wall_time=time.time(), file_version=_VERSION))
        self.flush()

    def get_logdir(self) -> str:
        return str(self._run_dir)

    def add_event(self, event: Event) -> None:
        self._records.write(event.SerializeToString())
        if self._clock() - self._flushed > _FLUSH_SECONDS:
            self.flush()

    def flush(self) -> None:
        self._stream.flush()
        self._flushed = self._clock()

    def close(self) -> None:
        self._stream.close()
