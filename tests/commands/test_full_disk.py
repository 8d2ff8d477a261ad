"""Every command that writes, on a disk that takes no more: one sentence, and the old file stays."""

import contextlib
import shutil
import sys

import pytest

from ncrs.cli import main
from ncrs.evolution.optimizers import SepCMAESSettings
from ncrs.runs.settings import TrainConfig
from ncrs.training.trainer import train

resource = pytest.importorskip("resource")

COMMANDS = {
    "film": ["--episodes", "1", "--speed", "4", "--height", "240", "--format", "mp4"],
    "film gif": ["--episodes", "1", "--speed", "4", "--height", "240", "--format", "gif"],
    "render": ["--size", "64"],
    "figures": ["--episodes", "1"],
    "report": ["--episodes", "1", "--elites", "champion"],
    "results": [],
    "evaluate": ["--episodes", "2"],
    "archive": ["--export", "csv"],
    "archive pyribs": ["--export", "pyribs"],
    "archive reestimate": ["--reestimate", "--episodes", "1"],
}
SLOW = ("film gif", "figures", "archive pyribs", "archive reestimate")


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    optimizer = SepCMAESSettings(sigma=0.02, population=16)
    settings = {"generations": 1, "episodes": 2, "champion_every": 1, "champion_episodes": 2}
    train(TrainConfig(optimizer=optimizer, start_from="light_chase/best", **settings), folder)
    return folder


@contextlib.contextmanager
def files_of_at_most(size):
    """Let writing a larger file fail, as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.skipif(sys.platform == "win32", reason="limits are of POSIX")
@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow) if name in SLOW else name for name in COMMANDS],
)
def test_old_files_stay_and_nothing_else_is_left(name, run, tmp_path, capsys):
    if "pyribs" in name:
        pytest.importorskip("ribs")
    command = name.split()[0]
    output = tmp_path / "output"
    arguments = [command, str(run), "--output", str(output), *COMMANDS[name]]
    main(arguments)
    old = {path: path.read_bytes() for path in output.rglob("*") if path.is_file()}
    assert old
    limit = 64 if command in ("results", "evaluate") else 400
    with files_of_at_most(limit), pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    error = capsys.readouterr().err.splitlines()[-1]
    assert error.startswith("ncrs: Could not write")
    assert "intact" in error
    assert {path: path.read_bytes() for path in output.rglob("*") if path.is_file()} == old
    assert [path.name for path in tmp_path.iterdir()] == ["output"]
    shutil.rmtree(output)
