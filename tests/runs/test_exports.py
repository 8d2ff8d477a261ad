"""Archives in pyribs' format, as pyribs itself reads, tabulates and draws them."""

import gzip
import pickle

import numpy as np
import pytest

from ncrs.cli import main
from ncrs.evolution.archive import Archive, MeasureSpace
from ncrs.runs.elites import EliteArchive, make_archive
from ncrs.runs.exports import ExportError, to_pyribs, write_pyribs
from ncrs_envs.tasks import TaskSettings

pytest.importorskip("ribs")
GRID = 3


@pytest.fixture
def archive():
    """An archive with an elite for each of the 84 triples, with genomes of two weights."""
    space = MeasureSpace(1, 2, GRID**2)
    count = len(space.triples)
    generator = np.random.default_rng(0)
    filled = Archive(space, 2, GRID)
    filled.add(
        generator.normal(size=(count, 2)),
        generator.random(count),
        space.triples,
        generator.integers(0, 5, (count, GRID, GRID)).astype(np.int8),
        success=generator.random(count),
        generation=3,
        seeds=np.array([11, 1, 5, -1]),
    )
    return filled


@pytest.fixture
def saved(tmp_path):
    """The file of an archive with one elite."""
    task = TaskSettings(grid_size=GRID)
    archive = make_archive(task)
    genome = np.zeros((1, archive.dimension))
    body = np.array([[[2, 1, 2], [4, 1, 4], [0, 1, 0]]], dtype=np.int8)
    archive.add(genome, np.array([0.4]), np.array([[2, 2, 7]]), body)
    EliteArchive(task, archive, 4).save(tmp_path / "archive.npz")
    return tmp_path / "archive.npz"


def unpickled(path):
    with gzip.open(path) as stream:
        return pickle.load(stream)


def test_every_triple_has_its_own_cell(archive):
    grid = to_pyribs(archive)
    assert len(grid) == len(archive) == 84
    data = grid.data()
    order = np.lexsort(data["measures"].T[::-1])
    np.testing.assert_array_equal(data["measures"][order], archive.measures)
    np.testing.assert_array_equal(data["solution"][order], archive.column("genomes"))
    np.testing.assert_array_equal(data["objective"][order], archive.column("fitness"))
    np.testing.assert_array_equal(data["evaluation_seed"][order], archive.column("seeds"))
    bodies = data["body"][order].reshape(-1, GRID, GRID)
    np.testing.assert_array_equal(bodies, archive.column("bodies"))


def test_the_same_archive_gives_the_same_file(archive, tmp_path):
    used = [np.full(10**6, number, dtype=np.float32) for number in range(20)]
    del used  # the memory that the second file's empty cells get
    for name in ("first", "second"):
        write_pyribs(archive, tmp_path / name)
    assert (tmp_path / "first").read_bytes() == (tmp_path / "second").read_bytes()


def test_the_table_of_pyribs(archive):
    table = to_pyribs(archive).data(return_type="pandas").sort_values("index")
    assert len(table) == 84
    assert {"objective", "generation", "success", "body_0", "body_8"} <= set(table.columns)
    bodies = table.get_field("body").reshape(-1, GRID, GRID)
    np.testing.assert_array_equal(bodies, archive.column("bodies"))
    assert len(list(table.iterelites())) == 84


def test_a_pair_of_measures_keeps_the_fittest(archive):
    grid = to_pyribs(archive, ("cells", "sensors"))
    best = {}
    for (sensors, wheels, cells), fitness in zip(
        archive.measures.tolist(), archive.column("fitness"), strict=True
    ):
        best[cells, sensors] = max(best.get((cells, sensors), (0.0, 0)), (fitness, wheels))
    data = grid.data()
    found = {
        tuple(measures): (fitness, wheels)
        for measures, fitness, wheels in zip(
            data["measures"].tolist(), data["objective"], data["wheels"], strict=True
        )
    }
    assert found == best
    assert grid.dims.tolist() == [7, 7]  # 3 to 9 cells, 1 to 7 sensors


@pytest.mark.parametrize("axes", [("sensors", "sensors"), ("weight",), ()])
def test_axes_that_the_archive_lacks_are_refused(archive, axes):
    with pytest.raises(ExportError, match="different measures among sensors, wheels, cells"):
        to_pyribs(archive, axes)


def test_an_empty_archive_is_exported():
    assert to_pyribs(Archive(MeasureSpace(1, 2, 9), 2, GRID), ("wheels", "cells")).empty


def test_pyribs_draws_the_archive(archive):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    plt = pytest.importorskip("matplotlib.pyplot")
    visualize = pytest.importorskip(
        "ribs.visualize", reason="pyribs' plots need ribs[visualize]", exc_type=ImportError
    )
    figure, (left, right) = plt.subplots(1, 2)
    visualize.parallel_axes_plot(to_pyribs(archive), ax=left)
    visualize.grid_archive_heatmap(to_pyribs(archive, ("sensors", "cells")), ax=right)
    assert len(left.lines) == 84
    drawn = right.collections[0].get_array()
    assert drawn.shape == (7, 7)
    assert drawn.max() == archive.column("fitness").max()
    plt.close(figure)


def test_the_command_writes_a_compressed_archive(saved):
    main(["archive", str(saved), "--export", "pyribs"])
    path = saved.parent / "archive_pyribs.pkl.gz"
    assert len(unpickled(path)) == 1
    assert path.stat().st_size < 1e6  # of 6 MB


def test_the_command_takes_a_pair_of_measures(saved):
    main(["archive", str(saved), "--export", "pyribs", "--axes", "sensors", "cells"])
    grid = unpickled(saved.parent / "archive_pyribs_sensors_cells.pkl.gz")
    assert grid.data("measures").tolist() == [[2, 7]]
    assert grid.data("wheels").tolist() == [2]


@pytest.mark.parametrize("export", [["--export", "csv"], []])
def test_axes_without_pyribs_are_refused(saved, capsys, export):
    with pytest.raises(SystemExit):
        main(["archive", str(saved), "--axes", "cells", *export])
    assert "--axes choose the grid of --export pyribs" in capsys.readouterr().err
