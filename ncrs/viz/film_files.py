"""Writers of MP4 and GIF files, to which frames are given one by one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ncrs.runs.checkpoint import replace_synced, writing
from ncrs.viz.errors import VizError

_GIF_WIDTH = 540
_GIF_FPS = 12.5
_GIF_COLORS = 160


class FilmWriter(ABC):
    """Writer of one film; its file appears only when it is complete."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._frames = 0
        self._unfinished = path.with_name(f".{path.stem}.tmp{path.suffix}")

    @abstractmethod
    def add(self, frame: NDArray[np.uint8], copies: int) -> None:
        """Show a frame, uint8 ``(height, width, 3)``, for ``copies`` frames' time."""

    @abstractmethod
    def _finish(self) -> None:
        """Write what is left."""

    @abstractmethod
    def _frames_written(self) -> int:
        """Count the frames in the unfinished file; raise ``OSError`` if it is not whole."""

    def close(self, *, keep: bool) -> None:
        """Finish the file, check it, and put it in its place; without ``keep``, remove it.

        Raises:
            CheckpointError: If the file could not be written whole; an older one is intact then.
        """
        with writing(self._path):
            try:
                self._finish()
                if keep:
                    written = self._frames_written()
                    if written != self._frames:
                        raise OSError(f"{written} of {self._frames} frames were written")
                    replace_synced(self._unfinished, self._path)
            finally:
                self._unfinished.unlink(missing_ok=True)


class Mp4Writer(FilmWriter):
    """Writer of H.264 video in the pixel format that every browser and player reads."""

    def __init__(self, path: Path, size: tuple[int, int], fps: float) -> None:
        super().__init__(path)
        import imageio_ffmpeg

        self._pipe: Any = imageio_ffmpeg.write_frames(
            str(self._unfinished),
            size,
            fps=fps,
            codec="libx264",
            quality=7,
            pix_fmt_out="yuv420p",
            macro_block_size=2,
            output_params=["-movflags", "+faststart"],
        )
        self._pipe.send(None)

    def add(self, frame: NDArray[np.uint8], copies: int) -> None:
        """Encode the frame ``copies`` times."""
        data = np.ascontiguousarray(frame)
        self._frames += copies
        with writing(self._path):  # the encoder stops reading when it cannot write
            for _ in range(copies):
                self._pipe.send(data)

    def _finish(self) -> None:
        self._pipe.close()

    def _frames_written(self) -> int:
        # The encoder's exit code is not passed on: only the file can tell.
        from imageio_ffmpeg import count_frames_and_secs

        try:
            return int(count_frames_and_secs(str(self._unfinished))[0])
        except RuntimeError as error:
            raise OSError("the video encoder could not write all of it") from error


class GifWriter(FilmWriter):
    """Writer of a smaller film at half the rate, for pages that show no video."""

    def __init__(self, path: Path, size: tuple[int, int], fps: float) -> None:
        super().__init__(path)
        self._fps = fps
        width = min(_GIF_WIDTH, size[0])
        self._size = (width, round(size[1] * width / size[0]))
        self._images: list[Image.Image] = []
        self._durations: list[int] = []

    def add(self, frame: NDArray[np.uint8], copies: int) -> None:
        """Keep the frame if one is due, else show the last one longer."""
        milliseconds = copies * 1000.0 / self._fps
        if self._images and self._durations[-1] < 1000.0 / _GIF_FPS:
            self._durations[-1] += round(milliseconds)
            return
        self._frames += 1
        small = Image.fromarray(frame).resize(self._size, Image.Resampling.LANCZOS)
        self._images.append(small.quantize(_GIF_COLORS, dither=Image.Dither.NONE))
        self._durations.append(round(milliseconds))

    def _finish(self) -> None:
        if not self._images:
            return
        self._images[0].save(
            self._unfinished,
            save_all=True,
            append_images=self._images[1:],
            duration=self._durations,
            loop=0,
        )

    def _frames_written(self) -> int:
        # Equal frames in a row are one image in the file: its last image must be readable.
        with Image.open(self._unfinished) as film:
            film.seek(getattr(film, "n_frames", 1) - 1)
            film.load()
        return self._frames


def check_encoder() -> None:
    """Check that there is an encoder for MP4.

    Raises:
        VizError: If there is none.
    """
    try:
        import imageio_ffmpeg

        imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError) as error:
        raise VizError(
            "There is no video encoder for MP4: install one with pip install 'ncrs[viz]', or write "
            "a GIF alone with --format gif."
        ) from error


def open_writers(paths: Sequence[Path], size: tuple[int, int], fps: float) -> list[FilmWriter]:
    """Open a writer for each path, by its suffix.

    Args:
        paths: Files to write, ``.mp4`` or ``.gif``.
        size: Width and height of the frames in pixels.
        fps: Frames per second.

    Raises:
        VizError: If a suffix is unknown, a folder does not exist, or there is no video encoder.
    """
    kinds: dict[str, Any] = {".mp4": Mp4Writer, ".gif": GifWriter}
    for path in paths:
        if path.suffix not in kinds:
            raise VizError(f"A film must be {' or '.join(kinds)}, got {path.suffix or path.name}.")
        if not path.parent.is_dir():
            raise VizError(f"Cannot write {path}: there is no folder {path.parent}.")
    if any(path.suffix == ".mp4" for path in paths):
        check_encoder()
    return [kinds[path.suffix](path, size, fps) for path in paths]
