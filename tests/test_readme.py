"""The documents work: their Python blocks, command lines, names, paths and links."""

from __future__ import annotations

import configparser
import importlib
import json
import re
import runpy
import shlex
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

import ncrs
from ncrs.training.arguments import check_arguments
from ncrs.training.hydra import register
from tests.documents import (
    COMMAND,
    DOCS,
    DOCUMENTS,
    PAGES,
    README,
    ROOT,
    TINY,
    TRAIN,
    blocks,
    call,
    command_lines,
    is_notebook,
    name_of,
)

SETUP = configparser.ConfigParser(interpolation=None)
SETUP.read(ROOT / "setup.cfg")

# What the blocks of a document leave behind, and the values expected.
EXPECTED = {
    "README.md": {
        "info['success']": True,
        "states.shape": [10, 5, 5, 12],
        "observations.shape": [4096, 3, 3],
        "result.fitness.shape": [8],
        "result.success.shape": [8, 12],
        "genomes.shape": [8, 4572],
    },
    "environments.md": {
        "scenario.light": [20.0, 30.0],
        "observations.shape": [4096, 3, 3],
        "seen.shape": [4096, 5, 5],
        "vectors.observation_space.shape": [2],
        "contrasts.shape": [512, 5],
        "sorted(observation)": ["body", "sensors"],
    },
    "training.md": {
        "run.curves['fitness/mean'].shape": [2],
        "longer.curves['fitness/mean'].shape": [3],
        "longer.finished": True,
    },
    "how/spaces.md": {"len(body)": 5, "np.load('body.npy').shape": [4572]},
    "tutorials/by_hand.md": {
        "float(success)": 1.0,
        "round(float(fitness), 3)": 0.738,
        "run.champion.genome.shape": [4572],
        "bool(run.champion.fitness > 0.62)": True,
    },
    "published_code.md": {
        "env.unwrapped.settings.construction": "jointed",
        "bool(right > 0.6)": True,
        "round(float(wrong), 2)": 0.01,
    },
    "results.md": {
        "round(float(blind.fitness[0]), 3)": 0.36,
        "bool(abs(blind.success.mean() - 0.148) < 0.005)": True,
        "bool(abs(blind.crossed.mean() - 0.68) < 0.005)": True,
    },
    "damage.md": {
        "int(info['body'][1, 1])": 0,
        "bool(result.success.mean() == 1.0)": True,
        "bool(result.recovered.mean() == 1.0)": True,
    },
    "extending.md": {
        "len(run.curves['fitness/best'])": 3,
        "result.fitness.shape": [1],
        "envs.observation_space.shape": [8, 5, 5],
        "ahead.config.scenarios": "in_front",
        "round(float(1000 * (plain.fitness - frugal.fitness)[0]))": 25,
    },
}


def _by_document(documents: list[Path]) -> list[object]:
    return [
        pytest.param(line, id=f"{name_of(document)}: {line}")
        for document in documents
        for line in dict.fromkeys(command_lines(document))
    ]


def _as_script(cell: str) -> str:
    """Leave the notebook's own commands out of a cell."""
    return re.sub(r"^( *)[%!].*$", r"\1pass", cell, flags=re.MULTILINE)


# The site's build runs the notebook.
LONG = ("training.md", "extending.md", "damage.md", "tutorials/by_hand.md")


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow) if name in LONG else name for name in EXPECTED],
)
def test_python_blocks_run_one_after_another(name, tmp_path):
    document = README if name == README.name else DOCS / name
    expected = EXPECTED[name]
    values = ", ".join(f"{text!r}: {text}" for text in expected)
    code = "\n".join(
        [
            *map(_as_script, blocks(document, "python")),
            f"import json; print(json.dumps({{{values}}}))",
        ]
    )
    printed = call([sys.executable, "-"], tmp_path, code)
    assert json.loads(printed.splitlines()[-1]) == expected


def _check_pip(arguments: list[str]) -> None:
    if "-e" in arguments:
        extras = re.findall(r"[\w-]+", arguments[arguments.index("-e") + 1])
        assert set(extras) <= SETUP["options.extras_require"].keys()


def _check_dask(arguments: list[str]) -> None:
    command, *rest = arguments
    program = importlib.import_module(f"distributed.cli.dask_{command}").main
    known = {option for parameter in program.params for option in parameter.opts}
    assert {word for word in rest if word.startswith("--")} <= known


def _check_ncrs(arguments: list[str], printed: Callable[[], str]) -> None:
    command, *rest = arguments
    sys.argv = ["ncrs", command, "--help"]
    with pytest.raises(SystemExit, match="0"):
        runpy.run_module("ncrs", run_name="__main__")
    shown = printed()
    assert [word for word in rest if word.startswith("--") and word not in shown] == []


def _check_train(arguments: list[str], folder: Path) -> None:
    # Only a run that exists can be resumed.
    given = [word for word in arguments if not word.startswith(("resume=", "start_from=runs/"))]
    (folder / "FOLDER" / "experiment").mkdir(parents=True)
    (folder / "FOLDER" / "experiment" / "mine.yaml").write_text("# @package _global_\nseed: 3\n")
    register()
    check_arguments(given, ROOT / "conf")


@pytest.mark.parametrize("line", _by_document(DOCUMENTS))
def test_command_lines_parse(line, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["train.py"])
    program, *arguments = shlex.split(line)
    if program == "mpirun":
        number, count, *rest = arguments
        assert (number, count.isdigit()) == ("-n", True)
        assert rest[:3] == ["python", "-m", "mpi4py.futures"]
        program, arguments = "python", rest[3:]
    if program == "pip":
        _check_pip(arguments)
    elif program == "dask":
        _check_dask(arguments)
    elif program == "ncrs" and arguments[0] == "train":
        _check_train(arguments[1:], tmp_path)
    elif program == "ncrs":
        _check_ncrs(arguments, lambda: capsys.readouterr().out)
    elif program == "python" and arguments[0] == "train.py":
        _check_train(arguments[1:], tmp_path)
    elif program == "python" and arguments[0] == "-m":
        own = ROOT / f"{arguments[1].replace('.', '/')}.py"
        assert own.is_file() or arguments[1] in SETUP["options.extras_require"]["docs"]
    elif program == "python":
        assert (ROOT / arguments[0]).is_file()
    else:
        tools = {"pytest", "tensorboard", "ruff", "mypy", "lint-imports", "pre-commit"}
        assert program in tools | {"codespell", "proselint"}


@pytest.fixture(scope="module")
def folder_with_a_run(tmp_path_factory):
    """A folder that holds a tiny run as ``runs/RUN``."""
    folder = tmp_path_factory.mktemp("readme")
    start = ["start_from=light_chase/best", "hydra.run.dir=runs/RUN"]
    call([*TRAIN, *shlex.split(TINY), *start], folder)
    return folder


NCRS_LINES = [line for line in command_lines(README) if line.startswith("ncrs ")]
TRAIN_LINES = [line for line in command_lines(README) if line.startswith("python train.py ")]


@pytest.mark.slow
@pytest.mark.parametrize("line", [line for line in NCRS_LINES if "play" not in line])
def test_the_readmes_ncrs_commands_run(line, folder_with_a_run):
    run = folder_with_a_run / "runs" / "RUN"
    before = {path: path.stat().st_mtime_ns for path in run.iterdir()}
    printed = call([*COMMAND, *shlex.split(line)[1:]], folder_with_a_run)
    made = {path.name for path in run.iterdir() if path.stat().st_mtime_ns != before.get(path)}
    assert (
        made
        == {
            "render": {"body.png", "growth_and_episodes.png", "episodes.gif"},
            "evaluate": {"evaluation.json"},
            "results": {"results.csv", "results.json", "results.md"},
            "archive": set(),
            "live": {"live.html"},
            "report": {"report"},
            "film": {"film.mp4", "film.gif"},
            "figures": {"figures"},
        }[line.split()[1]]
    )
    assert printed


@pytest.mark.slow
@pytest.mark.parametrize("line", TRAIN_LINES)
def test_the_readmes_training_commands_run(line, folder_with_a_run):
    given = shlex.split(line)[2:]
    names = [word.split("=")[0] for word in given]
    tiny = [word for word in shlex.split(TINY) if word.split("=")[0] not in names]
    if "resume" in names:  # a run keeps its settings, and may only be prolonged
        given, tiny = ["resume=runs/RUN", "generations=2"], []
    folders = set(folder_with_a_run.glob("runs/**/config.json"))
    call([*TRAIN, *given, *tiny], folder_with_a_run)
    made = set(folder_with_a_run.glob("runs/**/config.json")) - folders
    assert len(made) == (0 if "resume" in names else 4 if "-m" in names else 1)


def test_every_python_block_runs_somewhere():
    """Cells run when the site is built; other blocks here, or with a run of their own."""
    with_blocks = {name_of(page) for page in PAGES if blocks(page, "python")}
    notebooks = {name_of(page) for page in PAGES if is_notebook(page)}
    assert with_blocks - notebooks - set(EXPECTED) == {"quality_diversity.md"}


@pytest.mark.parametrize("document", DOCUMENTS, ids=name_of)
def test_names_paths_and_links_exist(document):
    text = document.read_text()
    names = re.findall(r"`(ncrs(?:_envs)?(?:\.\w+)+)\b", text)
    assert [name for name in dict.fromkeys(names) if not _resolves(name)] == []
    paths = re.findall(r"`((?:\.ci|conf|ncrs|ncrs_envs|tests|benchmarks)/[\w/.]*)`", text)
    paths = [path for path in paths if "NAME" not in path]
    assert [path for path in dict.fromkeys(paths) if not (ROOT / path).exists()] == []
    links = [link for link in re.findall(r"\]\(([^)#]+)\)", text) if "://" not in link]
    assert [link for link in links if not (document.parent / link).exists()] == []


def _resolves(name: str) -> bool:
    """True if a dotted name is a module, or something in one."""
    parts = name.split(".")
    for end in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:end]))
        except ModuleNotFoundError:
            continue
        for attribute in parts[end:]:
            found = getattr(found, attribute, None)
        return found is not None
    return False


def test_the_readme_is_short():
    assert 800 <= len(README.read_text().split()) <= 1000


def test_versions_and_steps_agree():
    setup = (ROOT / "setup.cfg").read_text()
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "tests.yml").read_text())
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert citation["version"] == ncrs.__version__
    job = workflow["jobs"]["tests"]
    pythons = re.findall(r"Python :: (3\.\d+)", setup)
    assert job["strategy"]["matrix"]["python"] == pythons == ["3.10", "3.11", "3.12", "3.13"]
    called = [step["run"].split()[1] for step in job["steps"] if "run" in step]
    defined = re.findall(r"^step_(\w+)\(\)", (ROOT / ".ci" / "run").read_text(), flags=re.MULTILINE)
    assert called == [step for step in defined if step != "packages"]
