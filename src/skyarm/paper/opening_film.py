"""The film that the report opens with: both controllers on one of the flights that were just flown."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path

from skyarm.film.film_settings import FilmSettings
from skyarm.film.make_film import make_film
from skyarm.film.offscreen import NoDisplayError
from skyarm.log.flight_log import Log

CASE = "case3"
"""The circle: the only case in which the base and both joints move all the time."""

SETTINGS = FilmSettings(
    layout="over", camera="fixed", width=640, height=360, fps=12, speed=2.5, start=0.0, stop=20.0,
    title="Case 3: the baseline (PD) and the paper's law (CT)",
)  # fmt: skip
"""Eight seconds, small enough to stand in the page."""

WORDS = "Case 3 at {speed:g} times its speed: {laws}, and the ghost of where they should be; below, the tip's error."


def opening_film(flown: Mapping[str, Mapping[str, Log]]) -> tuple[bytes, str] | None:
    """Film the circle of Case 3.

    Args:
        flown: case -> controller -> log.

    Returns:
        Animated WebP and the sentence that says what it shows; None where this machine cannot draw one.
    """
    logs = flown[CASE]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "film.webp"
        try:
            make_film(list(logs.values()), file, SETTINGS, labels=list(logs))
        except NoDisplayError:
            return None
        return file.read_bytes(), WORDS.format(speed=SETTINGS.speed, laws=" and ".join(logs))
