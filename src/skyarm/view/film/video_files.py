"""Video file formats: MP4 (H.264) and animated WebP."""

from __future__ import annotations

import io
import itertools
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
from PIL import Image

from skyarm.records.arrays import Pixels
from skyarm.records.files import must_be_one_of, needs_extra, shown, write_atomically

Frames = Iterator[Pixels]

QUALITY = "20"
"""Constant rate factor of H.264; below 18 no difference is visible, at 23 the grid
begins to swim."""

WEBP_QUALITY = 80
"""Quality of WebP, 0 to 100; below 75 moving parts leave specks behind."""

WEBP_KEY = 2
"""Frames from one key frame to the next. libwebp keeps blocks that differ little from
the frame before, so that slow changes of shade leave patches until a whole frame is
written."""

MOST_IN_MEMORY = 1.5e9
"""Largest size (bytes) of the pictures of an animated WebP, which are held until the
last is drawn."""

USUAL, USUAL_IN_MEMORY = (1280, 720, 30), (800, 450, 15)
"""Default width, height and frame rate of a film, and of an animated WebP, whose limit
a flight of 30 s then meets, also on a page."""


def write_mp4(
    path: Path, frames: Frames, size: tuple[int, int], fps: int, count: int
) -> Path:
    """Write frames as an MP4 file (H.264) that browsers and slide programs play.

    Raises:
        ValueError: the library for it is missing.
    """
    # the writers have one signature: MP4 needs no number of frames
    del count
    av = import_av()
    # a file, not memory: the table of frames is moved to the front at the end, so that
    # a browser plays at once
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "film.mp4"
        with av.open(
            str(made), "w", format="mp4", options={"movflags": "faststart"}
        ) as container:
            stream = container.add_stream(
                "libx264", rate=fps, options={"crf": QUALITY, "preset": "veryfast"}
            )
            stream.width, stream.height = size
            # 4:2:0, which browsers decode; it asks for even edges
            stream.pix_fmt = "yuv420p"
            for pixels in frames:
                container.mux(
                    stream.encode(
                        av.VideoFrame.from_ndarray(
                            np.ascontiguousarray(pixels), format="rgb24"
                        )
                    )
                )
            container.mux(stream.encode(None))
        return write_atomically(path, made.read_bytes())


def write_webp(
    path: Path, frames: Frames, size: tuple[int, int], fps: int, count: int
) -> Path:
    """Write frames as an animated WebP that repeats for ever.

    Raises:
        ValueError: its frames would not fit into memory.
    """
    if 3 * size[0] * size[1] * count > MOST_IN_MEMORY:
        most = f"{MOST_IN_MEMORY / 1e9:g} GB"
        raise ValueError(
            f"film = {shown(path)}: {count} frames of {size[0]}x{size[1]} are more"
            f" than {most}; take .mp4, or a lower fps, a smaller size, a shorter span"
        )
    return write_atomically(path, webp_bytes(frames, fps))


def webp_bytes(frames: Frames, fps: int) -> bytes:
    """Encode frames as an animated WebP that repeats for ever."""
    first, *rest = map(Image.fromarray, frames)
    # whole milliseconds that add up to the film's length
    edges = [round(1e3 * k / fps) for k in range(len(rest) + 2)]
    durations = [after - before for before, after in itertools.pairwise(edges)]
    buffer = io.BytesIO()
    # 0 loops are without end; libwebp wants kmin below kmax
    first.save(
        buffer,
        "WEBP",
        save_all=True,
        append_images=rest,
        duration=durations,
        loop=0,
        quality=WEBP_QUALITY,
        # of 0 to 6: Pillow's usual 0 wrote 29 % more bytes of ten test frames, 6 took
        # over six times as long for 2 % less (measured)
        method=4,
        allow_mixed=True,
        kmin=WEBP_KEY - 1,
        kmax=WEBP_KEY,
    )
    return buffer.getvalue()


Writer = Callable[[Path, Frames, tuple[int, int], int, int], Path]

FILM_FORMATS: dict[str, Writer] = {"mp4": write_mp4, "webp": write_webp}
"""Suffix -> function (path, frames of (height, width, 3) bytes, (width, height), frame
rate, number of frames) -> path."""


def require_film_format(path: Path, others: tuple[str, ...] = ()) -> str:
    """Return a file's suffix if it is that of a film or one of ``others``, or raise an
    error.

    Raises:
        ValueError: no such format, or its library is missing.
    """
    suffix = path.suffix.removeprefix(".").lower()
    allowed = (*FILM_FORMATS, *others)
    if suffix not in allowed:
        raise ValueError(
            f"film = {shown(path)}: suffix {shown(suffix)}:"
            f" {must_be_one_of(allowed, suffix)}"
        )
    # before any picture is computed, so that a missing package is said at once
    if suffix == "mp4":
        import_av()
    return suffix


def usual_size_and_rate(path: Path) -> tuple[int, int, int]:
    """Default width, height and frames per second of a film, by its file's suffix."""
    return USUAL_IN_MEMORY if path.suffix.lower() == ".webp" else USUAL


def import_av() -> ModuleType:
    """Import PyAV, the video encoder, with an error that names it if it is not
    installed.

    Raises:
        ValueError: it is missing.
    """
    try:
        import av
    except ImportError:
        raise ValueError(
            f"av: is missing; a film in MP4 {needs_extra('film')}; .webp needs no more"
        ) from None
    module: ModuleType = av
    return module
