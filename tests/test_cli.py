"""The command line: help and version at once, completion, listing, bad input."""

import importlib
import os
import signal
import subprocess
import sys
import time

import pytest

import ncrs
from ncrs.cli import COMMANDS, main

BASH = pytest.mark.skipif(sys.platform == "win32", reason="needs bash")


def run(*arguments, **environment):
    command = [sys.executable, "-m", "ncrs", *arguments]
    done = subprocess.run(
        command, capture_output=True, text=True, env={**os.environ, **environment}
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_help_starts_nothing_heavy():
    code = (
        "import sys, ncrs.cli\n"
        "try: ncrs.cli.main(['--help'])\n"
        "except SystemExit: pass\n"
        "print([name for name in ('torch', 'numpy', 'gymnasium', 'hydra') if name in sys.modules])"
    )
    started = time.monotonic()
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout
    assert time.monotonic() - started < 5.0  # 0.1 s on an idle machine
    assert printed.splitlines()[-1] == "[]"
    assert all(f"    {name}" in printed for name in COMMANDS)


def test_the_version_is_the_packages():
    assert run("--version").strip() == f"ncrs {ncrs.__version__}"


@pytest.mark.parametrize("name", sorted(set(COMMANDS) - {"train"}))
def test_each_command_has_a_module_and_help(name, capsys):
    assert importlib.import_module(f"ncrs.commands.{name}").__doc__.startswith(f"``ncrs {name}``")
    with pytest.raises(SystemExit, match="0"):
        main([name, "--help"])
    printed = capsys.readouterr().out
    writes = name not in ("champions", "play")
    assert ("--output DIR" in printed) == writes
    takes_a_robot = name in ("evaluate", "render", "film", "play", "live", "report")
    assert ("--measures SENSORS WHEELS CELLS" in printed) == takes_a_robot


def test_champions_are_listed_with_their_tests(capsys):
    main(["champions"])
    header, *lines = capsys.readouterr().out.splitlines()
    assert header.split() == ["champion", "fitness", "success", "cells", "wheels", "sensors"]
    assert [line.split()[0] for line in lines] == ncrs.champions()
    (best,) = (line for line in lines if line.startswith("light_chase/best"))
    assert best.split()[1:] == ["0.650", "100.0%", "of", "1,000", "25", "15", "10"]


@pytest.mark.slow
@BASH
def test_settings_are_completed():
    assert "complete" in run("train", "-sc", "install=bash")
    line = "ncrs train optimizer="
    completed = run("-sc", "query=bash", COMP_LINE=line, COMP_POINT=str(len(line)))
    assert "optimizer=cma_mae" in completed.split()
    assert "optimizer=sep_cma_es" in completed.split()


def test_every_public_name_is_there():
    assert sorted(ncrs.__all__) == ncrs.__all__
    assert set(ncrs.__all__) <= set(dir(ncrs))
    for name in ncrs.__all__:
        assert getattr(ncrs, name).__name__ == name
    with pytest.raises(AttributeError, match="no attribute 'no_such_name'"):
        ncrs.no_such_name  # noqa: B018


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_ctrl_c_ends_a_command_without_a_traceback():
    code = (
        "import signal, sys, ncrs.cli, ncrs.commands.champions as champions\n"
        # A shell's background jobs ignore it.
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "champions.add_arguments = lambda parser: signal.raise_signal(signal.SIGINT)\n"
        "ncrs.cli.main(['champions'])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == -signal.SIGINT
    assert done.stderr == ""


@pytest.mark.skipif(sys.platform == "win32", reason="pipes of POSIX")
def test_a_reader_that_leaves_ends_a_command_without_a_traceback():
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-m", "ncrs", "champions"]
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True)
    os.close(writer)
    assert done.returncode == 1
    assert done.stderr == ""
