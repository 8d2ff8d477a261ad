"""Checkpoints: whole or not at all."""

import io
import json
import os
import sys
import zipfile

import numpy as np
import pytest

import ncrs.runs.checkpoint
from ncrs.runs.checkpoint import (
    CheckpointError,
    CheckpointFolder,
    CheckpointWarning,
    read_state,
    write_json,
    write_state,
)


def state(value=0):
    return {
        "generation": value,
        "float": 0.1 + 0.2,
        "infinite": float("-inf"),
        "big": 2**127 + 1,
        "none": None,
        "nested": {"matrix": np.asfortranarray(np.arange(6.0).reshape(2, 3)), "flag": True},
        "list": [np.arange(3, dtype=np.int8), 1.5, "text"],
    }


def test_round_trip_keeps_values_dtypes_and_memory_layout(tmp_path):
    path = tmp_path / "state.npz"
    write_state(path, state())
    loaded = read_state(path)
    assert {k: v for k, v in loaded.items() if k not in ("nested", "list")} == {
        k: v for k, v in state().items() if k not in ("nested", "list")
    }
    matrix = loaded["nested"]["matrix"]
    np.testing.assert_array_equal(matrix, state()["nested"]["matrix"])
    assert matrix.flags.f_contiguous
    assert loaded["list"][0].dtype == np.int8
    assert loaded["list"][1:] == [1.5, "text"]


def test_another_format_is_refused_by_name(tmp_path, monkeypatch):
    path = tmp_path / "state.npz"
    with monkeypatch.context() as later:
        later.setattr(ncrs.runs.checkpoint, "FORMAT", 2)
        write_state(path, state())
    with pytest.raises(CheckpointError, match=r"has the format 2; this version of ncrs reads 1"):
        read_state(path)


def test_what_unpacks_to_more_than_the_file_is_not_read(tmp_path):
    path = tmp_path / "state.npz"
    np.savez_compressed(path, json=np.zeros(10**8, dtype=np.uint8))
    assert path.stat().st_size < 2e5
    with pytest.raises(CheckpointError, match="is compressed, as ncrs never writes it"):
        read_state(path)


def test_headers_that_declare_more_than_there_is_are_not_believed(tmp_path):
    path = tmp_path / "state.npz"
    header = {"descr": "<f8", "fortran_order": False, "shape": (10**12,)}
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, header)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("json.npy", stream.getvalue() + b"few bytes")
    with pytest.raises(CheckpointError, match="declares 8,000,000,000,"):
        read_state(path)


def test_reading_executes_nothing(tmp_path):
    path = tmp_path / "state.npz"
    with pytest.raises(TypeError, match="Python objects"):
        write_state(path, {"array": np.array([object()])})
    np.savez(path, json=np.array([print], dtype=object))
    with pytest.raises(CheckpointError, match="not a whole checkpoint"):
        read_state(path)


@pytest.mark.parametrize("keep", [0.0, 0.3, 0.999])
def test_truncated_files_are_recognised(tmp_path, keep):
    path = tmp_path / "state.npz"
    write_state(path, state())
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * keep)])
    with pytest.raises(CheckpointError, match="not a whole checkpoint"):
        read_state(path)


def test_one_altered_byte_is_recognised(tmp_path):
    path = tmp_path / "state.npz"
    write_state(path, {"array": np.zeros(1000)})
    data = bytearray(path.read_bytes())
    data[500] ^= 1
    path.write_bytes(bytes(data))
    with pytest.raises(CheckpointError, match="not a whole checkpoint"):
        read_state(path)


def test_no_altered_byte_of_a_header_passes(tmp_path):
    # Headers and directory: all that is not one of the array's many equal bytes.
    path = tmp_path / "state.npz"
    values = np.full(5000, 0.5)
    write_state(path, {"array": values, "number": 7})
    data = path.read_bytes()
    first = data.index(values[:1].tobytes() * 2)
    positions = [*range(first + 8), *range(first + values.nbytes - 8, len(data))]
    recognised = 0
    for place in positions:
        altered = bytearray(data)
        altered[place] ^= 1 << place % 8
        path.write_bytes(bytes(altered))
        try:
            loaded = read_state(path)
        except CheckpointError:
            recognised += 1
        else:  # such as the date of a member
            assert loaded.keys() == {"array", "number"}, place
            assert loaded["number"] == 7, place
            np.testing.assert_array_equal(loaded["array"], values, strict=True)
    assert recognised > 0.7 * len(positions)


def test_the_newest_two_are_kept(tmp_path):
    folder = CheckpointFolder(tmp_path / "checkpoints")
    for generation in (0, 5, 9, 100):
        folder.save(generation, state(generation))
    assert [path.name for path in folder.paths()] == [
        "generation_00000100.npz",
        "generation_00000009.npz",
    ]
    assert folder.load()["generation"] == 100


def test_a_damaged_checkpoint_is_passed_over_with_a_warning(tmp_path):
    folder = CheckpointFolder(tmp_path)
    for generation in (1, 2):
        folder.save(generation, state(generation))
    newest = folder.paths()[0]
    newest.write_bytes(newest.read_bytes()[:-100])
    with pytest.warns(
        CheckpointWarning,
        match=r"It is now generation_00000002.npz.damaged; the run resumes from generation_0+1",
    ):
        assert folder.load()["generation"] == 1
    folder.save(3, state(3))  # beside the whole one, not the damaged one
    assert [path.name for path in folder.paths()] == [
        "generation_00000003.npz",
        "generation_00000001.npz",
    ]
    for path in folder.paths():
        path.write_bytes(b"")
    with pytest.raises(CheckpointError, match="No whole checkpoint"):
        folder.load()


def test_a_checkpoint_that_cannot_be_read_is_not_taken_for_a_damaged_one(tmp_path):
    folder = CheckpointFolder(tmp_path)
    folder.save(1, state(1))
    (tmp_path / "generation_00000002.npz").mkdir()  # as a file without permission, or a lost disk
    with pytest.raises(CheckpointError, match=r"Could not read .*generation_00000002"):
        folder.load()
    assert [path.name for path in folder.paths()] == [
        "generation_00000002.npz",
        "generation_00000001.npz",
    ]


def test_no_checkpoint(tmp_path):
    with pytest.raises(CheckpointError, match="was not started there"):
        CheckpointFolder(tmp_path / "nowhere").load()


def test_saving_in_the_background(tmp_path):
    folder = CheckpointFolder(tmp_path)
    for generation in (1, 2, 3):  # each waits for the one before
        folder.save_in_background(generation, state(generation))
    assert folder.load()["generation"] == 3
    assert [path.name for path in folder.paths()] == [
        "generation_00000003.npz",
        "generation_00000002.npz",
    ]


@pytest.mark.parametrize("then", ["save", "save_in_background", "wait"])
def test_a_failure_in_the_background_is_raised_once(tmp_path, then):
    blocked = tmp_path / "file"
    blocked.write_text("")
    folder = CheckpointFolder(blocked)
    folder.save_in_background(1, state(1))
    with pytest.raises(CheckpointError, match="Could not write"):
        folder.wait() if then == "wait" else getattr(folder, then)(2, state(2))
    folder.wait()


def test_what_a_killed_writer_left_is_removed(tmp_path):
    left = tmp_path / ".generation_00000001.npz.tmp"
    left.write_bytes(b"half a file")
    CheckpointFolder(tmp_path).save(2, state(2))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["generation_00000002.npz"]


@pytest.mark.skipif(sys.platform != "linux", reason="needs /dev/full")
def test_a_full_disk_leaves_the_old_file_intact(tmp_path, monkeypatch):
    path = tmp_path / "state.npz"
    write_state(path, state(1))
    # Writing through this link meets a device without space.
    (tmp_path / ".state.npz.tmp").symlink_to("/dev/full")
    with pytest.raises(CheckpointError, match=r"(?i)no space left.*intact"):
        write_state(path, state(2))
    assert read_state(path)["generation"] == 1


def test_a_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(CheckpointError, match="Could not write"):
        write_state(tmp_path / "file" / "state.npz", state())
    with pytest.raises(CheckpointError, match="Could not write"):
        write_state(tmp_path / "missing" / "state.npz", state())


def test_files_have_the_usual_permissions(tmp_path):
    write_json(tmp_path / "value.json", {"a": [1, None]})
    assert json.loads((tmp_path / "value.json").read_text()) == {"a": [1, None]}
    mask = os.umask(0)
    os.umask(mask)
    assert (tmp_path / "value.json").stat().st_mode & 0o777 == 0o666 & ~mask
