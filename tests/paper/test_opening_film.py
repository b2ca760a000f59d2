"""The film that the report opens with, or none where nothing can be drawn."""

from __future__ import annotations

import dataclasses
import io

import numpy as np
import pytest

import skyarm
from skyarm.paper import report_pages as room
from skyarm.paper.report_pages import opening_film
from skyarm.view.film.offscreen import NoDisplayError, offscreen


@pytest.fixture(scope="module")
def flown() -> dict[str, dict[str, skyarm.Log]]:
    laws = {"PD": "paper_pd", "CT": "paper_ct"}
    return {"case3": {name: skyarm.run(skyarm.load_scenario("case3", controller=law)) for name, law in laws.items()}}


def test_it_shows_both_laws_and_moves(flown: dict[str, dict[str, skyarm.Log]], monkeypatch: pytest.MonkeyPatch) -> None:
    try:
        with offscreen():
            pass
    except NoDisplayError as error:
        pytest.skip(str(error))
    monkeypatch.setattr(room, "FILM_SETTINGS", dataclasses.replace(room.FILM_SETTINGS, width=320, height=180, fps=2))
    drawn = opening_film(flown)
    assert drawn is not None
    content, words = drawn
    assert "PD and CT" in words
    from PIL import Image

    film = Image.open(io.BytesIO(content))
    frames = getattr(film, "n_frames", 1)
    # 20 s at 2.5 times their speed, two frames a second; both ends are drawn
    assert frames in {16, 17}
    pictures = []
    for k in (2, 8):
        film.seek(k)
        pictures.append(np.asarray(film.convert("RGB"), dtype=int))
    assert np.abs(pictures[0] - pictures[1]).max() > 50


def test_without_a_display_there_is_none(
    flown: dict[str, dict[str, skyarm.Log]], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise NoDisplayError("no EGL")

    monkeypatch.setattr(room, "make_film", refuse)
    assert opening_film(flown) is None
