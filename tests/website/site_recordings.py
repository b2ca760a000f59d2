"""Recordings of flights for the pages of the site: which there are, and how they are
made.

They are made with the site and not kept. Each is one page that holds player and flight,
so that it plays from a file.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Planned:
    """A recording: a scenario, the laws that fly it beside each other, and which
    seconds of it are shown.
    """

    scenario: str
    laws: Sequence[str]
    start: float
    stop: float


RECORDINGS = {
    "case2": Planned("case2", ("centroidal_tip",), 5.0, 20.0),
    "case3_wind": Planned(
        "case3_wind", ("paper_pd", "paper_ct", "centroidal_tip"), 5.0, 17.0
    ),
    "gust": Planned("case2_gust", ("paper_ct", "centroidal_joint"), 6.0, 14.0),
    "centroidal_modes": Planned(
        "case3_wind", ("centroidal_joint", "centroidal_tip"), 5.0, 17.0
    ),
}
"""Name, as pages ask for it -> what is recorded."""

FRAMES = 20
"""A second."""


def make_recordings(folder: Path, names: Sequence[str]) -> list[Path]:
    """Write ``NAME.html`` of each; none where the extra studio is not installed."""
    import skyarm

    try:
        from skyarm.view.film.make_film import FilmSettings
        from skyarm.view.film.recording import import_viser, record, save_recording

        import_viser()
    except ValueError:  # one line that names the extra
        return []
    written = []
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        planned = RECORDINGS[name]
        logs = [
            skyarm.run(
                skyarm.load_scenario(
                    planned.scenario, controller=law, duration=planned.stop
                )
            )
            for law in planned.laws
        ]
        settings = FilmSettings(start=planned.start, stop=planned.stop, fps=FRAMES)
        written.append(save_recording(record(logs, settings), folder / f"{name}.html"))
    return written


ASKED = re.compile(r"^<!-- recording: ([\w-]+) \| (.+?) -->$", re.M)
"""A place for a recording on a page: its name, and the words below it."""


def asked_for(texts: Sequence[str]) -> list[str]:
    """Names that pages ask for; ValueError for one that is not planned."""
    names = sorted({name for text in texts for name, _ in ASKED.findall(text)})
    for name in names:
        if name not in RECORDINGS:
            raise ValueError(
                f"recording {name!r}: must be one of {', '.join(RECORDINGS)}"
            )
    return names
