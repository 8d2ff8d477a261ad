"""Parts of pages that are made from the package: nothing is left out."""

from __future__ import annotations

import dataclasses
import importlib
import re
import shutil
import sys
from pathlib import Path

import gymnasium
import pytest

import ncrs
import ncrs_envs
from ncrs.cli import COMMANDS
from ncrs.evolution.optimizers import OPTIMIZERS
from ncrs.report.build import write_parts
from ncrs.runs.engine_settings import EngineSettings
from ncrs.runs.settings import TrainConfig
from ncrs_envs.perturbing import PerturbationSettings
from ncrs_envs.tasks import BUILT_IN, PAPER_TASKS, TaskSettings
from tests.documents import DOCS, PAGES


@pytest.fixture
def maker(monkeypatch):
    """Imports a module of ``docs/_ext``, as the site's configuration does."""
    monkeypatch.setattr(sys, "path", [str(DOCS / "_ext"), *sys.path])
    return importlib.import_module


def test_every_setting_is_described(maker):
    tables = maker("settings_tables")
    for text, record, prefix in (
        (tables.run_settings(), TrainConfig, ""),
        (tables.task_settings(), TaskSettings, "task."),
        (tables.engine_settings(), EngineSettings, "engine."),
        (tables.perturbation_settings(), PerturbationSettings, "perturbations."),
    ):
        groups = ("task", "optimizer", "engine", "perturbations")
        names = [field.name for field in dataclasses.fields(record) if field.name not in groups]
        described = re.findall(rf"^`{prefix}(\w+)`\n: \S.+ Default: `.*`\.$", text, re.MULTILINE)
        assert described == names


def test_every_optimizers_settings_are_described(maker):
    text = maker("settings_tables").optimizer_settings()
    for name, entry in OPTIMIZERS.items():
        assert f"`optimizer={name}`\n: " in text
        for field in dataclasses.fields(entry.settings):
            assert field.name == "name" or f"`optimizer.{field.name}`\n: " in text


def test_every_command_has_its_arguments(maker):
    text = maker("command_lines").command_line()
    assert re.findall(r"^## ncrs (\w+)$", text, re.MULTILINE) == list(COMMANDS)
    assert text.count("`--output DIR`") == len(COMMANDS) - 3  # train, champions and play
    assert "`--seed SEED`\n: Seed for sampling the scenarios; default: 0\n" in text
    assert "`--format {mp4,gif} [{mp4,gif} ...]`" in text


HEADINGS = (
    "Description", "Action Space", "Observation Space", "Info", "Rewards", "Starting State",
    "Episode End", "Arguments", "Version History",
)  # fmt: skip


@pytest.mark.parametrize("task", [task.name for task in BUILT_IN])
def test_an_environments_page_has_all_that_gymnasiums_have(maker, task, monkeypatch, tmp_path):
    pages = maker("environment_pages")
    monkeypatch.setattr(pages, "PICTURES", tmp_path)
    monkeypatch.setattr(pages, "_EPISODES", 1)
    monkeypatch.setattr(pages, "_SIZE", 64)
    env_id = ncrs_envs.get_task(task).env_id
    text = pages.environment(env_id)
    assert tuple(re.findall(r"^## (.+)$", text, re.MULTILINE)) == HEADINGS
    assert (tmp_path / f"{env_id}.gif").read_bytes()[:6] == b"GIF89a"
    assert f"`{gymnasium.make(env_id).action_space}`" in text
    assert f"<!-- environment {env_id} -->" in (DOCS / "environments" / f"{task}.md").read_text()


def test_every_public_name_is_described(maker):
    pages = sorted((DOCS / "reference").glob("api*.md"))
    text = maker("error_list").errors() + "".join(page.read_text() for page in pages)
    names = [
        f"{package.__name__}.{name}" for package in (ncrs, ncrs_envs) for name in package.__all__
    ]
    assert [name for name in names if not re.search(rf"{re.escape(name)}`?$", text, re.M)] == []


def test_every_error_is_listed_with_its_kinds(maker):
    text = maker("error_list").errors()
    assert "`ncrs_envs.ScenarioError`\n: A scenario that is malformed" in text
    assert re.search(
        r"`ncrs.runs.sources.SourceError`\n: .* Also a `LookupError` and a `ValueError`.", text
    )
    defined = [
        name
        for package in (ncrs, ncrs_envs)
        for path in Path(package.__path__[0]).rglob("*.py")
        for name in re.findall(r"^class ([A-Z]\w*Error)\(", path.read_text(), re.MULTILINE)
    ]
    assert sorted(re.findall(r"^`[\w.]+\.(\w+)`$", text, re.MULTILINE)) == sorted(defined)


def test_documents_of_the_top_folder_link_within_the_site(maker):
    text = maker("repository_files").document("CONTRIBUTING.md")
    assert "](glossary.md)" in text
    assert "](changelog.md)" in text


def test_every_mark_has_a_maker(maker):
    pytest.importorskip("sphinx", reason="the extra docs is not installed")
    makers = maker("generated").MAKERS
    marks = [re.findall(r"^<!-- (\w+)", page.read_text(), re.MULTILINE) for page in PAGES]
    assert {name for names in marks for name in names} == set(makers)


@pytest.mark.parametrize("task", PAPER_TASKS, ids=lambda task: task.name)
def test_the_archives_have_pages(task, tmp_path):
    page = DOCS / "archives" / task.name / "index.html"
    link = f'<a href="{page.relative_to(DOCS).as_posix()}">{task.title}</a>'
    assert link in (DOCS / "quality_diversity.md").read_text(encoding="utf-8")
    text = page.read_text(encoding="utf-8")
    assert f"{task.title}, drafts" in text
    write_parts(tmp_path)
    shutil.copytree(page.parent, tmp_path, dirs_exist_ok=True)
    needed = re.findall(r'(?:src|href)="([\w./-]+)"', text)
    assert len(needed) >= 14
    for name in needed:
        assert (tmp_path / name).is_file(), name
