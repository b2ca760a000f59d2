"""``skyarm film``: what it writes, and how it refuses; a film that is cut off leaves
nothing.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import skyarm
from skyarm.cli.commands import perform
from skyarm.studies.compare.suite import PAPER_CASES
from skyarm.view.film import recording, video_files
from skyarm.view.film.make_film import FilmSettings, make_film
from skyarm.view.picture import offscreen
from support.commands import skyarm as skyarm_command
from support.pictures import flight, needs_display, why_no_pictures

SMALL = ("--size", "160x120", "--fps", "10")


Film = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return skyarm.save_log(flight(), tmp_path_factory.mktemp("flown") / "pd.npz")


@pytest.fixture
def film(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> Film:
    """``skyarm film`` with these words, in this process and in a new folder: exit code,
    output, errors.
    """

    def perform_film(*words: object) -> tuple[int, str, str]:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["skyarm", "film", *map(str, words)])
        code = perform()
        said = capfd.readouterr()
        return code, said.out, said.err

    return perform_film


@needs_display
def test_a_log_and_a_scenario_are_filmed_together(
    film: Film, log: Path, tmp_path: Path
) -> None:
    code, out, err = film(log, "case3_wind", "--window", 0, 0.5, *SMALL, "made.webp")
    assert (code, err) == (0, "")
    assert out.startswith("film: made.webp (0.0")
    with Image.open(tmp_path / "made.webp") as picture:
        assert (picture.size, picture.n_frames) == ((160, 120), 5)
    assert [path.name for path in tmp_path.iterdir()] == ["made.webp"]


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (
            ("LOG", "a.avi"),
            (
                "skyarm: film = 'a.avi': suffix 'avi': must be one of mp4, webp, viser,"
                " html"
            ),
        ),
        (
            ("LOG", "a.mp5"),
            "skyarm: film = 'a.mp5': suffix 'mp5': did you mean 'mp4'? must be one of",
        ),
        (("no.npz", "a.webp"), "skyarm: "),
        (
            ("LOG", "a.webp", "--size", "161x120"),
            "skyarm: size = '161x120': must be even numbers from 64 to 4096",
        ),
        (
            ("LOG", "a.webp", "--size", "160x8000"),
            "skyarm: size = '160x8000': must be even numbers from 64 to 4096",
        ),
        (
            ("LOG", "a.webp", "--size", "big"),
            "skyarm: size = 'big': must be WIDTHxHEIGHT in pixels",
        ),
        (
            ("LOG", "a.webp", "--camera", "folow"),
            "skyarm: camera = 'folow': did you mean 'follow'? must be one of",
        ),
        (
            ("LOG", "a.webp", "--window", "2", "3"),
            "skyarm: start = 2: must leave at least one frame before the end, 1 s",
        ),
        (
            ("LOG", "a.webp", "--label", "x", "--label", "y"),
            "skyarm: labels = ['x', 'y']: must be as many as the",
        ),
        (
            ("LOG", "a.webp", "--laws", "paper_ct"),
            "skyarm: --laws = 'paper_ct': must be left out",
        ),
        (
            ("case3", "case3_wind"),
            "skyarm: FILE = 'case3_wind': must be the film's file, the last word",
        ),
        (("LOG", ""), "skyarm: FILE = '': must be the path of a file"),
    ],
)
def test_wrong_words_are_one_line_and_nothing_is_left(
    words: tuple[str, ...], line: str, film: Film, log: Path, tmp_path: Path
) -> None:
    code, out, err = film(*(log if word == "LOG" else word for word in words))
    assert (code, out) == (2, "")
    assert err.startswith(line)
    assert len(err.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_what_is_missing_is_named_with_what_brings_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for name, call, line in (
        (
            "av",
            lambda: make_film(flight(), tmp_path / "a.mp4"),
            r"av: is missing; a film in MP4 needs the extra 'film'",
        ),
        (
            "viser",
            lambda: recording.record(flight()),
            r"viser: is missing; a recording needs the extra 'studio'",
        ),
    ):
        monkeypatch.setitem(sys.modules, name, None)
        with pytest.raises(ValueError, match=line):
            call()


def test_without_egl_the_package_is_named(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(offscreen, "LIBRARY", "libNoSuchEGL.so.1")
    with pytest.raises(
        ValueError,
        match=(
            r"libNoSuchEGL.so.1: is missing, .*: apt-get install libegl1"
            r" libgl1-mesa-dri"
        ),
    ):
        make_film(
            flight(), tmp_path / "a.webp", FilmSettings(width=64, height=64, fps=5)
        )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(
    not os.path.exists("/usr/lib") or sys.platform != "linux",
    reason="EGL's loader is Linux's",
)
def test_without_a_driver_the_package_is_named(tmp_path: Path) -> None:
    if why_no_pictures():
        pytest.skip(why_no_pictures())
    (tmp_path / "none").mkdir()
    code = (
        "from skyarm.view.picture.offscreen import offscreen, NoDisplayError\ntry:\n   "
        " offscreen().__enter__()\nexcept NoDisplayError as error:\n    print(error)"
    )
    hidden = {**os.environ, "__EGL_VENDOR_LIBRARY_DIRS": str(tmp_path / "none")}
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env=hidden,
    )
    assert done.stdout.startswith("EGL: ")
    assert done.stdout.strip().endswith("apt-get install libegl1 libgl1-mesa-dri")


def test_pictures_that_do_not_fit_into_memory_are_refused(tmp_path: Path) -> None:
    with pytest.raises(
        ValueError, match=r"600 frames of 1280x720 are more than 1.5 GB; take .mp4"
    ):
        video_files.write_webp(tmp_path / "a.webp", iter(()), (1280, 720), 30, 600)


def test_a_slow_change_of_a_shade_is_seen_in_a_webp(tmp_path: Path) -> None:
    # grain as of a photograph, so that the frames are compressed with loss; a corner
    # blinks, so that none is left out
    grain = np.random.default_rng(0).normal(60.0, 6.0, (96, 128, 1))
    frames = [
        np.repeat(np.clip(grain + 1.5 * k, 0, 255).astype(np.uint8), 3, axis=2)
        for k in range(40)
    ]
    for k, frame in enumerate(frames):
        frame[:16, :16] = 255 * (k % 2)
    file = video_files.write_webp(tmp_path / "a.webp", iter(frames), (128, 96), 15, 40)
    with Image.open(file) as film:
        assert film.n_frames == 40
        for k, frame in enumerate(frames):
            film.seek(k)
            blocks = (
                (np.asarray(film.convert("RGB"), float) - frame)
                .reshape(12, 8, 16, 8, 3)
                .mean(axis=(1, 3))
            )
            # of 58 that the shade changes; 7, which is seen, with a whole frame in
            # five, 20 without whole frames
            assert np.abs(blocks[2:, 2:]).max() < 4.0


def test_every_flight_of_the_paper_fits_into_an_animated_picture_of_the_usual_size(
    tmp_path: Path,
) -> None:
    for suffix in ("webp", "WEBP"):
        width, height, fps = video_files.usual_size_and_rate(tmp_path / f"a.{suffix}")
        for name in PAPER_CASES:
            frames = fps * skyarm.load_scenario(name).duration
            assert 3 * width * height * frames < video_files.MOST_IN_MEMORY, (
                suffix,
                name,
            )
    assert video_files.usual_size_and_rate(tmp_path / "a.mp4") == (1280, 720, 30)


@needs_display
def test_a_size_and_a_rate_that_are_left_out_are_those_of_the_file(
    film: Film, log: Path, tmp_path: Path
) -> None:
    assert film(log, "--window", 0, 0.4, "a.webp")[0] == 0
    with Image.open(tmp_path / "a.webp") as picture:
        assert (picture.size, picture.n_frames) == ((800, 450), 6)


@needs_display
@pytest.mark.thorough
def test_a_film_that_is_cut_off_leaves_nothing(tmp_path: Path) -> None:
    flown = skyarm.save_log(flight(), tmp_path / "pd.npz")
    work, scratch = tmp_path / "work", tmp_path / "scratch"
    work.mkdir()
    scratch.mkdir()
    (work / "a.mp4").write_bytes(b"earlier")
    words = [
        sys.executable,
        "-m",
        "skyarm",
        "film",
        str(flown),
        "a.mp4",
        "--speed",
        "0.01",
        "--size",
        "320x240",
    ]
    running = subprocess.Popen(
        words,
        cwd=work,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "TMPDIR": str(scratch)},
    )
    # the encoder's own file is there once the first frames are drawn
    deadline = time.monotonic() + 60.0
    while (
        not list(scratch.rglob("film.mp4"))
        and time.monotonic() < deadline
        and running.poll() is None
    ):
        time.sleep(0.05)
    running.send_signal(signal.SIGINT)
    _, told = running.communicate(timeout=60)
    *progress, last = told.splitlines()  # a slow machine tells how far it is
    assert (running.returncode, last) == (
        130,
        "skyarm: interrupted; finished files are whole",
    )
    assert all(line.startswith("skyarm: filming") for line in progress)
    assert (work / "a.mp4").read_bytes() == b"earlier"
    assert [path.name for path in work.iterdir()] == ["a.mp4"]
    assert list(scratch.rglob("film.mp4")) == []


@needs_display
def test_flights_have_labels_as_in_a_plot(
    film: Film, log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = list[list[str] | None]()

    def note(_logs: object, path: Path, *_: object, **more: Any) -> Path:
        drawn.append(more["labels"])
        path.write_bytes(b"film")
        return path

    monkeypatch.setattr("skyarm.cli.film_command.write_film", note)
    assert film(f"first={log}", log, "made.webp")[0] == 0
    assert (
        film("gust=case3", "made.webp", "--laws", "own,paper_pd", "--window", 0, 0.1)[0]
        == 0
    )
    assert drawn[0] is not None
    assert drawn[0][0] == "first"
    assert drawn[1] == ["gust, own", "gust, paper_pd"]
    twice = film(f"first={log}", f"first={log}", "made.webp")
    assert (twice[0], "must have another name" in twice[2]) == (2, True)
    both = film(f"first={log}", "made.webp", "--label", "a")
    assert (both[0], "--label: must be left out" in both[2]) == (2, True)


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("A=case3", "A=case3_wind"), "flight = 'A=case3_wind': must have another"),
        (("A=case3", "--label", "q"), "--label: must be left out beside NAME=FLIGHT"),
        (("case3", "--label", "p", "--label", "q"), "labels = ['p', 'q']: must be as"),
        (("case3", "no.npz"), "flight = 'no.npz': no such file"),
        (
            ("A=case3", "--laws", "paper_ct,paper_ct"),
            (
                "--laws = ['paper_ct', 'paper_ct']: must be a list of different presets"
                " or laws; 'paper_ct' and 'paper_ct' are one"
            ),
        ),
    ],
)
def test_labels_and_laws_are_refused_before_a_flight_is_flown(
    words: tuple[str, ...],
    line: str,
    film: Film,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    def fly(*_: object) -> None:
        raise AssertionError("nothing may be flown here")

    monkeypatch.setattr("skyarm.cli.film_command.run", fly)
    monkeypatch.setattr("skyarm.cli.film_command._require_renderer", lambda **_: None)
    code, out, err = film(*words, "--out", "made.webp")
    assert (code, out) == (2, "")
    assert err.startswith(f"skyarm: {line}")
    assert len(err.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@needs_display
def test_a_log_is_filmed_without_the_plugin_of_its_law(tmp_path: Path) -> None:
    assert skyarm_command("new", "law", "own_tilt", "--out", str(tmp_path)).code == 0
    flown = tmp_path / "flown.npz"
    words = ["case1", "--laws", f"{tmp_path / 'own_tilt.py'}:make", "--duration", "0.1"]
    # in a process of its own, so that the plugin is not loaded here
    subprocess.run(
        [sys.executable, "-m", "skyarm", "run", *words, "--log", flown], check=True
    )
    with pytest.raises(ValueError, match="is not loaded"):
        _ = skyarm.load_log(flown).scenario
    made = skyarm.film(flown, tmp_path / "made.webp", width=160, height=120)
    assert made.stat().st_size > 0
