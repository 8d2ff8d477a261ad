"""Event files: each step of each tag once, in order, whatever was killed and whenever."""

import os
import socket
import threading
import time
from pathlib import Path

import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from ncrs.training.events import KEPT_FILE, RunWriter, keep_events


def session(folder, steps, name=None):
    """Write one session's file; ``name`` is what another clock would have called it."""
    before = set(folder.iterdir())
    writer = RunWriter(folder)
    for step in steps:
        writer.add_scalar("fitness/best", float(step), step)
    writer.close()
    (file,) = set(folder.iterdir()) - before
    if name is not None:
        file.rename(folder / name)


def curve(folder):
    accumulator = EventAccumulator(str(folder)).Reload()
    if "fitness/best" not in accumulator.Tags()["scalars"]:
        return []
    return [event.step for event in accumulator.Scalars("fitness/best")]


@pytest.mark.parametrize("start", [0, 1, 3, 5])
def test_a_resumed_run_has_each_step_once(tmp_path, start):
    session(tmp_path, range(5))
    keep_events(tmp_path, start)
    assert curve(tmp_path) == list(range(min(start, 5)))
    session(tmp_path, range(start, 7))
    assert curve(tmp_path) == list(range(min(start, 5))) + list(range(start, 7))


def test_the_clock_may_go_back(tmp_path):
    session(tmp_path, range(4), f"events.out.tfevents.{int(time.time()) + 10**6}.host.1.0")
    keep_events(tmp_path, 2)
    session(tmp_path, range(2, 5), "events.out.tfevents.0000001000.host.1.0")
    keep_events(tmp_path, 4)
    session(tmp_path, range(4, 6))
    assert curve(tmp_path) == list(range(6))


def test_a_kill_while_the_events_are_gathered_repeats_none(tmp_path, monkeypatch):
    session(tmp_path, range(4))
    monkeypatch.setattr(os, "unlink", lambda path: None)  # killed before anything is removed
    keep_events(tmp_path, 3)
    monkeypatch.undo()
    assert len(list(tmp_path.iterdir())) == 2
    keep_events(tmp_path, 3)
    assert [path.name for path in tmp_path.iterdir()] == [KEPT_FILE]
    assert curve(tmp_path) == [0, 1, 2]


def test_half_an_event_at_the_end_is_dropped(tmp_path):
    session(tmp_path, range(4))
    (file,) = tmp_path.iterdir()
    file.write_bytes(file.read_bytes()[:-7])
    keep_events(tmp_path, 4)
    assert curve(tmp_path) == [0, 1, 2]


def test_events_can_be_read_while_the_run_goes_on(tmp_path):
    now = 0.0
    writer = RunWriter(tmp_path, lambda: now)
    writer.add_scalar("fitness/best", 0.0, 0)
    assert curve(tmp_path) == []
    now = 11.0
    writer.add_scalar("fitness/best", 1.0, 1)
    assert curve(tmp_path) == [0, 1]
    writer.add_scalar("fitness/best", 2.0, 2)
    writer.flush()
    assert curve(tmp_path) == [0, 1, 2]
    writer.close()
    writer.close()
    with pytest.raises(ValueError, match="is closed"):
        writer.add_scalar("fitness/best", 3.0, 3)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_is_the_callers_error_and_nothing_else(tmp_path, monkeypatch, capfd):
    threads = threading.active_count()
    with pytest.raises(OSError, match="No space left"):
        RunWriter(full_folder(tmp_path, monkeypatch))
    assert threading.active_count() == threads
    assert capfd.readouterr() == ("", "")


def full_folder(tmp_path, monkeypatch):
    """Make a folder whose next event file lies on a full disk."""
    monkeypatch.setattr("time.time", lambda: 1.0)
    monkeypatch.setattr("os.getpid", lambda: 2)
    name = f"events.out.tfevents.0000000001.{socket.gethostname()}.2"
    (tmp_path / name).symlink_to("/dev/full")
    return tmp_path
