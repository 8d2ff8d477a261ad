"""The event file of a run: after a kill it keeps each step of each tag once, in order."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from tensorboard.backend.event_processing.event_file_loader import RawEventFileLoader
from tensorboard.compat.proto.event_pb2 import Event
from tensorboard.summary.writer.record_writer import RecordWriter

from ncrs.runs.checkpoint import write_atomically

_PATTERN = "events.out.tfevents.*"
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
        version = Event(file_version="brain.Event:2", wall_time=chosen[0].wall_time)
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
