"""``skyarm plot`` and ``skyarm show -o`` as a user types them."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

import skyarm as library
from support.commands import refused, skyarm


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two logs of one scenario, in folders of their own."""
    folder: Path = tmp_path_factory.mktemp("logs")
    for law in ("paper_ct", "paper_pd"):
        log = library.run(library.load_scenario("case2", controller=law, duration=0.3))
        (folder / law).mkdir()
        log.save_npz(folder / law / "case2.npz")
        log.save_csv(folder / law / "case2.csv")
    return folder


@pytest.fixture
def folder(flown: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "logs").symlink_to(flown)
    return tmp_path


CT, PD = "logs/paper_ct/case2.npz", "logs/paper_pd/case2.npz"


def test_flights_are_drawn_into_the_file_named(folder: Path) -> None:
    done = skyarm(
        "plot", CT, PD, "-o", "both.svg", "--kind", "tip", "--window", "0", "0.2"
    )
    assert done.code == 0, done.err
    assert done.out == "picture: both.svg\n"
    text = (folder / "both.svg").read_text("utf-8")
    assert text.startswith("<?xml")
    again = skyarm(
        "plot", f"one = {CT}".replace(" = ", "="), f"other={PD}", "--out", "again.png"
    )
    assert again.code == 0, again.err
    assert {path.name for path in folder.iterdir()} == {"logs", "both.svg", "again.png"}


def test_a_vehicle_is_drawn_into_the_file_named(folder: Path) -> None:
    done = skyarm("show", "hummingbird_arm2", "-o", "bird.pdf")
    assert done.code == 0, done.err
    assert done.out == "drawing: bird.pdf\n"
    assert (folder / "bird.pdf").read_bytes().startswith(b"%PDF")
    refused(
        skyarm("show", "hummingbird_arm2", "-o", "bird.bmp"),
        "--out = 'bird.bmp'",
        "png, svg, pdf",
    )
    refused(
        skyarm("show", "hummingbird_arm3", "-o", "bird.png"),
        "hummingbird_arm3",
        "did you mean",
    )
    refused(skyarm("show", "case1", "-o", "bird.png"), "must be a vehicle")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("plot", CT), ("--out",)),
        (("plot", "-o", "a.png"), ("Missing argument",)),
        (
            ("plot", CT, "-o", "a.gif"),
            ("--out = 'a.gif': suffix 'gif'", "must be one of png, svg, pdf"),
        ),
        (("plot", CT, "-o", "a"), ("--out = 'a': suffix ''",)),
        (("plot", CT, "-o", ""), ("--out = '': must be the path of a file",)),
        (
            ("plot", CT, "-o", "a.png", "--kind", "speed"),
            ("kind = 'speed': must be one of tracking, attitude",),
        ),
        (
            ("plot", CT, "-o", "a.png", "--window", "3", "4"),
            ("window = [3, 4]: must overlap the flights", "0.3 s"),
        ),
        (
            ("plot", CT, "-o", "a.png", "--metric", "x"),
            ("--metric = ['x']: must come with a folder",),
        ),
        (
            ("plot", CT, "-o", "a.png", "--over", "x"),
            ("--over = 'x': must come with a folder",),
        ),
        (("plot", "gone.npz", "-o", "a.png"), ("flight = 'gone.npz': no such file",)),
        (("plot", "", "-o", "a.png"), ("flight = '': must be a log",)),
        (
            ("plot", CT, "-o", "a.png", "--kind", ""),
            ("kind = '': must be one of tracking",),
        ),
        (
            ("plot", "case3", "-o", "a.png"),
            ("flight = 'case3': must be a log that 'skyarm run SCENARIO",),
        ),
        (("plot", "logs/paper_ct/case2.csv", "-o", "a.png"), ("cannot be read back",)),
        (
            ("plot", f"a={CT}", f"a={PD}", "-o", "a.png"),
            ("flight = 'a=", "must have another name"),
        ),
        (("plot", CT, "logs", "-o", "a.png"), ("folder = 'logs': must stand alone",)),
        (("plot", "logs", "-o", "a.png"), ("--metric: is missing",)),
        (("plot", "logs", "-o", "a.png", "--metric", "a"), ("--over: is missing",)),
        (
            ("plot", "logs", "-o", "a.png", "--kind", "tip"),
            ("--kind = 'tip': must come with logs",),
        ),
        (
            ("plot", "logs", "-o", "a.png", "--metric", "a", "--over", "b"),
            ("folder = 'logs': must be one that 'skyarm sweep' wrote",),
        ),
    ],
    ids=lambda words: " ".join(words[1:4])[-40:] if isinstance(words, tuple) else "",
)
def test_wrong_input_is_one_line_and_draws_nothing(
    folder: Path, words: tuple[str, ...], said: tuple[str, ...]
) -> None:
    refused(skyarm(*words), *said)
    assert {path.name for path in folder.iterdir()} == {"logs"}


def test_a_sweep_is_drawn_over_an_expression(folder: Path) -> None:
    pytest.importorskip("pyarrow")
    from support.studies import MASS, WIND
    from support.studies import flown as fly

    fly(folder / "rows", episodes=12, duration=0.3, windows={"steady": [0.1, 0.3]})
    drawn = ("plot", "rows", "-o", "a.png", "--metric", "ee_error_mean", "--over")
    done = skyarm(*drawn, f"push = {WIND} / {MASS}")
    assert done.code == 0, done.err
    assert (folder / "a.png").read_bytes().startswith(b"\x89PNG")
    refused(skyarm(*drawn, f"{WIND}("), "over = ", "must not be called")


def test_the_command_that_flights_name_draws_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = skyarm(
        "run",
        "case2",
        "--laws",
        "paper_ct,paper_pd",
        "--duration",
        "0.1",
        "-o",
        "my logs",
    )
    (line,) = (each for each in done.out.splitlines() if each.startswith("picture: "))
    program, *words = shlex.split(line.removeprefix("picture: "))
    assert program == "skyarm"
    drawn = skyarm(*words)
    assert drawn.code == 0, drawn.err
    assert Path(words[-1]).is_file()
    assert Path(words[-1]).parent.name == "my logs"


def test_no_command_is_named_for_a_flight_that_is_drawn_or_that_no_command_reads(
    tmp_path: Path,
) -> None:
    words = ["run", "case2", "--duration", "0.1", "--log", str(tmp_path / "a.csv")]
    assert "skyarm plot" not in skyarm(*words).out
    drawn = skyarm(
        *words[:-2], "--log", str(tmp_path / "a.npz"), "--plot", str(tmp_path / "a.png")
    )
    assert f"picture: {tmp_path / 'a.png'}" in drawn.out
    assert "skyarm plot" not in drawn.out
