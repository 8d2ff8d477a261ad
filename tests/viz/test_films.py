"""Films: length, frames, formats, robots, and errors."""

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

from ncrs.cli import main
from ncrs.runs.elites import load_archive
from ncrs.runs.sources import load_robot
from ncrs.viz import film_files, films
from ncrs.viz.errors import VizError
from ncrs.viz.films import FilmSize, channel_picture, growth_frames, save_film, timed_frames
from ncrs.viz.options import FilmOptions
from ncrs_envs.canvas import SIGNED


@pytest.fixture(scope="module")
def robot(sweep):
    return load_robot(sweep / "0")


def test_mp4_and_gif_have_the_length_of_the_story(sweep, tmp_path, capsys):
    arguments = ["--output", str(tmp_path), "--episodes", "1", "--height", "240", "--speed", "1"]
    main(["film", str(sweep / "0"), *arguments])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["film.gif", "film.mp4"]
    seconds = 11 * 0.4 + 1.0 + 101 / 50 + 1.0
    frames, duration = imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "film.mp4"))
    assert duration == pytest.approx(seconds, abs=0.1)
    assert frames == pytest.approx(25 * seconds, abs=2)
    with Image.open(tmp_path / "film.gif") as film:
        assert film.size == (360, 240)
        assert film.info["loop"] == 0
        total = 0
        for index in range(film.n_frames):
            film.seek(index)
            total += film.info["duration"]
        assert total / 1000 == pytest.approx(seconds, abs=0.2)
    assert "film.mp4" in capsys.readouterr().out


def test_growth_starts_with_the_seed_and_ends_with_the_body(robot):
    frames = list(growth_frames(robot, FilmSize(240)))
    assert len(frames) == 11
    assert frames[0].shape == (240, 360, 3)
    assert (np.abs(frames[0].astype(int) - frames[-1])[:, :240] > 50).any()


def test_the_episode_moves(robot):
    options = FilmOptions(episodes=1, speed=1.0, height=240)
    frames = [frame for frame, _ in timed_frames(robot, options)]
    assert len(frames) == 12 + 102
    first, last = frames[12].astype(int), frames[-1]
    assert (np.abs(first - last)[:, :240] > 50).any()


@pytest.mark.slow
def test_progress_counts_every_frame(robot, tmp_path):
    options = FilmOptions(episodes=2, speed=1.0, height=240)
    seen = []
    save_film(robot, [tmp_path / "film.gif"], options, lambda *counts: seen.append(counts))
    total = 12 + 2 * 102
    assert seen == [(drawn, total) for drawn in range(1, total + 1)]


def test_channels_are_drawn_in_their_order():
    state = np.zeros((5, 5, 12), dtype=np.float32)
    state[0, 0, 6] = 9.0
    picture = channel_picture(state, 200)
    orange = np.argwhere((picture == SIGNED[-1]).all(axis=-1))
    pixels = ((204 // 5) - 4) // 5
    assert len(orange) == pixels**2
    assert orange.min(axis=0).tolist() == [5 * pixels + 4, 5 * pixels + 4]


def test_an_elite_and_a_genome_are_robots_too(sweep, tmp_path, robot):
    measures = load_archive(sweep / "2").archive.measures[0].tolist()
    elite = load_robot(sweep / "2", measures=measures)
    assert str(tuple(measures)) in elite.title
    path = tmp_path / "genome.npy"
    np.save(path, robot.nca.genome())
    again = load_robot(path, task="light_chase")
    np.testing.assert_array_equal(again.body, robot.body)
    assert again.title == "genome"
    assert np.isnan(again.fitness)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["{tmp}/none"], "does not exist"),
        (["{tmp}"], "holds no run"),
        (["{tmp}/young"], "has no champion yet"),
        (["{run}", "--measures", "9", "9", "9"], "is impossible: at least"),
        (["{run}", "--task", "obstacle"], "has its own"),
        (["{tmp}/genome.npy"], "name its task"),
        (["{tmp}/genome.npy", "--task", "carry_ball"], "has 4873 weights"),
        (["{tmp}/zeros.npy", "--task", "light_chase"], "grows no robot that can drive"),
        (["{tmp}/text.npy", "--task", "light_chase"], "not a numpy file"),
        (["{run}", "--height", "9"], "height must be from 240"),
        (["{run}", "--speed", "0"], "speed must be above 0"),
    ],
)
def test_bad_input_is_one_sentence(arguments, message, sweep, tmp_path, robot, capsys):
    young = tmp_path / "young"
    young.mkdir()
    (young / "config.json").write_text((sweep / "0" / "config.json").read_text())
    np.save(tmp_path / "genome.npy", robot.nca.genome())
    np.save(tmp_path / "zeros.npy", np.zeros(4572))
    (tmp_path / "text.npy").write_text("no numbers")
    with pytest.raises(SystemExit) as caught:
        main(["film", *(word.format(tmp=tmp_path, run=sweep / "0") for word in arguments)])
    assert caught.value.code == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_a_missing_encoder_is_one_sentence(sweep, tmp_path, monkeypatch, capsys):
    def missing():
        raise RuntimeError("No ffmpeg exe could be found.")

    monkeypatch.setattr(imageio_ffmpeg, "get_ffmpeg_exe", missing)
    with pytest.raises(SystemExit) as caught:
        main(["film", str(sweep / "0"), "--output", str(tmp_path)])
    assert caught.value.code == 2
    assert "no video encoder for MP4" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_film_that_fails_leaves_nothing(tmp_path):
    frame = np.zeros((240, 360, 3), dtype=np.uint8)
    for name in ("a.mp4", "a.gif"):
        (writer,) = film_files.open_writers([tmp_path / name], (360, 240), 25)
        writer.add(frame, 3)
        writer.close(keep=False)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(VizError, match=r"\.mp4 or \.gif"):
        film_files.open_writers([tmp_path / "a.avi"], (360, 240), 25)


def test_a_robot_that_lost_its_sensors_can_be_filmed():
    assert films._levels("sensors", np.zeros(0)) == "no sensors"
    assert films._levels("gas", np.array([0.5, 1.0])) == "gas 0.50 to 1.00"
