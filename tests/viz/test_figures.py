"""Figures: the files, and that the data beside them are the runs' own."""

import csv
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from PIL import Image

from ncrs.cli import main
from ncrs.runs.champion import load_champion_file
from ncrs.runs.elites import load_archive
from ncrs.runs.folders import find_runs, group_runs
from ncrs.runs.metrics import read_metrics
from ncrs.viz.errors import VizError
from ncrs.viz.figures import _plots, save_figures
from ncrs.viz.figures_archive import fitness_range
from ncrs.viz.figures_curves import fitness_plot
from ncrs.viz.figures_robots import positions_plot
from ncrs.viz.options import FigureOptions
from ncrs.viz.style import Plot, style
from ncrs_envs.canvas import SIGNED_LIMIT


def table(path):
    with path.open() as stream:
        return list(csv.DictReader(stream))


@pytest.fixture(scope="module")
def figures(sweep, tmp_path_factory):
    folder = tmp_path_factory.mktemp("figures")
    main(["figures", str(sweep), "--output", str(folder), "--episodes", "2"])
    return folder


def test_every_figure_is_a_png_an_svg_and_a_table(figures):
    stems = {path.stem for path in figures.iterdir()}
    methods = ("light_chase_sep_cma_es", "light_chase_map_elites")
    assert {"fitness", "designs", "archive_histogram"} <= stems
    assert {
        f"{kind}_{name}" for kind in ("channels", "positions", "archive") for name in methods
    } <= stems
    for stem in stems:
        with Image.open(figures / f"{stem}.png") as picture:
            assert min(picture.size) > 500  # 300 dots per inch
            assert np.asarray(picture.convert("L")).std() > 5
        assert ET.parse(figures / f"{stem}.svg").getroot().tag.endswith("svg")
        assert table(figures / f"{stem}.csv")


def test_fitness_is_the_median_of_the_seeds_over_what_all_have_done(sweep, figures):
    rows = [row for row in table(figures / "fitness.csv") if row["method"] == "sep_cma_es"]
    best = np.stack([read_metrics(sweep / run)["fitness/best"][:2] for run in "01"])
    assert len(rows) == 2
    assert [float(row["median"]) for row in rows] == np.median(best, axis=0).tolist()
    assert [float(row["lowest"]) for row in rows] == best.min(axis=0).tolist()
    assert {row["seeds"] for row in rows} == {"2"}


def test_designs_are_the_best_champions(sweep, figures):
    rows = {row["method"]: row for row in table(figures / "designs.csv")}
    best = max((load_champion_file(sweep / run) for run in "01"), key=lambda c: c.fitness)
    assert float(rows["sep_cma_es"]["fitness"]) == best.fitness
    assert len(rows["map_elites"]["body"].split("/")) == 5


def test_the_archive_table_holds_every_elite(sweep, figures):
    archive = load_archive(sweep / "2").archive
    rows = table(figures / "archive_light_chase_map_elites.csv")
    measures = [[int(row[name]) for name in ("sensors", "wheels", "cells")] for row in rows]
    assert measures == archive.measures.tolist()
    assert [float(row["fitness"]) for row in rows] == archive.column("fitness").tolist()
    counts = [
        float(row["elites_per_run"])
        for row in table(figures / "archive_histogram.csv")
        if row["method"] == "map_elites"
    ]
    assert sum(counts) == pytest.approx(len(archive))


def test_channels_and_positions(sweep, figures):
    champion = load_champion_file(sweep / "2")
    rows = table(figures / "channels_light_chase_map_elites.csv")
    assert len(rows) == 3 * 25 * 12
    assert list(dict.fromkeys(row["channel"] for row in rows)) == champion.nca.layout.channel_names
    seed = [row for row in rows if row["moment"] == "seed" and float(row["value"]) != 0.0]
    assert [(row["channel"], row["row"], row["column"]) for row in seed] == [("body", "2", "2")]
    positions = table(figures / "positions_light_chase_map_elites.csv")
    assert [row["episode"] for row in positions] == ["0", "1"]
    assert float(positions[0]["goal_x"]) == pytest.approx(-36.0, abs=3.0)


@pytest.mark.slow
def test_quantities_have_the_same_colours_in_all_figures(sweep):
    every = _plots(group_runs(find_runs([sweep])), FigureOptions(episodes=1))
    plots = [plot for plot in every if plot is not None]

    def ranges(kind):
        found = [plot.figure for plot in plots if plot.name.startswith(f"{kind}_light_chase")]
        assert len(found) == 2
        images = [image for figure in found for panel in figure.axes for image in panel.images]
        # Empty cells have a colour of their own.
        return {image.get_clim() for image in images if image.cmap.N > 1}

    fullest = [max("01", key=lambda run: len(load_archive(sweep / run).archive)), "2"]
    assert ranges("archive") == {fitness_range([load_archive(sweep / run) for run in fullest])}
    assert ranges("channels") == {(-SIGNED_LIMIT, SIGNED_LIMIT)}


def test_progress_counts_every_figure(sweep, tmp_path, monkeypatch):
    (tmp_path / "young").mkdir()
    (tmp_path / "young" / "config.json").write_text((sweep / "2" / "config.json").read_text())
    seen = []
    with pytest.raises(VizError, match="Nothing to draw yet"):
        save_figures([tmp_path / "young"], tmp_path, progress=lambda *counts: seen.append(counts))
    assert seen == [(done, 6) for done in range(1, 7)]
    seen.clear()
    options = FigureOptions(episodes=1)
    monkeypatch.setattr(Plot, "_drawn", lambda self, kind, metadata: b"drawing takes long")
    paths = save_figures([sweep / "2"], tmp_path, options, lambda *counts: seen.append(counts))
    assert seen == [(done, 6) for done in range(1, 7)]
    assert len(paths) == 3 * 6


def test_figures_repeat(figures, sweep, tmp_path):
    name = "positions_light_chase_map_elites"
    with style():
        champion = load_champion_file(sweep / "2")
        positions_plot(champion, name.removeprefix("positions_"), 2, 0).save(tmp_path)
    for kind in ("svg", "csv", "png"):
        first, second = ((folder / f"{name}.{kind}").read_bytes() for folder in (figures, tmp_path))
        assert first == second, kind


def test_evaluations_can_be_the_axis(sweep):
    plot = fitness_plot(group_runs(find_runs([sweep / "0"])), "evaluations")
    assert [row[3] for row in plot.rows] == [16.0, 32.0]
    with pytest.raises(VizError, match="must be one of"):
        FigureOptions(axis="hours")


def test_a_run_is_found_once(sweep):
    assert [run.folder.name for run in find_runs([sweep, sweep / "0"])] == ["0", "1", "2"]


def test_bad_input_is_one_sentence(tmp_path, sweep, capsys):
    empty = tmp_path / "empty"
    empty.mkdir()
    young = tmp_path / "young"
    young.mkdir()
    (young / "config.json").write_text((sweep / "0" / "config.json").read_text())
    cases = {
        "holds no run": [str(empty)],
        "is not a folder": [str(tmp_path / "none")],
        "Nothing to draw yet": [str(young)],
        "positive integer": [
            str(sweep / "0"),
            "--episodes",
            "0",
            "--output",
            str(tmp_path / "out"),
        ],
    }
    for message, arguments in cases.items():
        with pytest.raises(SystemExit) as caught:
            main(["figures", *arguments])
        assert caught.value.code == 2
        error = capsys.readouterr().err
        assert message in error
        assert error.count("\n") == 1
