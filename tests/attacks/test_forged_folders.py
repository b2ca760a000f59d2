"""Forged or damaged folders of studies: no traceback, no file outside, nothing called complete that is not."""

from __future__ import annotations

import contextlib
import io
import json
import random
import shutil
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest
from forged_folders import KINDS, chunk, manifest_of, manifest_path, origin_of

from skyarm.cli.main import main
from skyarm.sweep import load_study, run_sweep
from skyarm.sweep.maps import RobustnessMap
from sweeps import files_of
from thorough import sampled

pytest.importorskip("pyarrow")
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="pipes and links are made with POSIX calls")

STUDY = """
schema = 1
name = "quick"
scenario = "case3_wind"
controllers = ["paper_ct", "paper_pd"]
duration = 0.5
episodes = 24
chunk = 8
[windows]
steady = [0.2, 0.5]
[vary]
"plant.vehicle.base.mass" = { uniform = [0.6, 0.9] }
"environment.wind.force_W.x" = { normal = [1.0, 0.5] }
"""


@pytest.fixture(autouse=True)
def _one_metric_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """In place of six, which would take most of the time."""
    monkeypatch.setattr("skyarm.sweep.banded_curves.MOST", 1)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study flown to its end, beside its file."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "study.toml").write_text(STUDY)
    run_sweep(load_study(folder / "study.toml"), folder / "flown")
    return folder


def victim(whole: Path, place: Path) -> Path:
    """A copy that may be forged; what lies around it must stay as it is."""
    shutil.copytree(whole, place, dirs_exist_ok=True)
    (place / "precious").write_text("precious")
    return place / "flown"


def performed(*arguments: str) -> tuple[int, str, str]:
    """Exit code, output and errors of a command; a traceback is an exception here."""
    out, err, before = io.StringIO(), io.StringIO(), sys.argv
    sys.argv = ["skyarm", *arguments]
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main()
    except SystemExit as stop:
        return int(stop.code or 0), out.getvalue(), err.getvalue()
    finally:
        sys.argv = before
    raise AssertionError("a command ends with SystemExit")


def around(folder: Path) -> dict[str, bytes]:
    return {name: held for name, held in files_of(folder.parent).items() if not name.startswith("flown/")}


class Scripts(HTMLParser):
    """Tags that a page of ours does not have."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found += [tag] if tag in ("script", "iframe", "b") else []


def attack(whole: Path, folder: Path, *arguments: str) -> int:
    """Perform a command on a forged folder and look at all that must not happen."""
    before = around(folder)
    code, out, err = performed(*arguments)
    assert code in (0, 2), (code, out, err)
    assert "Traceback" not in err
    if code == 2:
        assert err.startswith("skyarm: ")
        assert err.count("\n") == 1, err
    assert around(folder) == before
    rows = [path.name for path in sorted((whole / "flown" / "rows").iterdir())]
    right = all(
        (folder / "rows" / name).is_file()
        and (folder / "rows" / name).read_bytes() == (whole / "flown" / "rows" / name).read_bytes()
        for name in rows
    )
    if arguments[0] == "sweep" and code == 0:
        assert right, "called complete"
        assert manifest_of(folder) == manifest_of(whole / "flown")
    if arguments[0] == "stats" and code == 0:
        found = json.loads((folder / "stats" / "stats.json").read_text())
        assert ("incomplete" in out) is not found["complete"]
        assert found["rows"] <= 48
        assert found["complete"] is (found["rows"] == 48)
        page = (folder / "stats" / "report.html").read_text()
        assert ("incomplete: " in page) is not found["complete"]
        scripts = Scripts()
        scripts.feed(page)
        assert scripts.found == []
        if origin_of(folder).digest == origin_of(whole / "flown").digest if manifest_is_whole(folder) else True:
            assert right or not found["complete"]
    return code


def manifest_is_whole(folder: Path) -> bool:
    try:
        return isinstance(manifest_of(folder)["study"], dict)
    except (OSError, ValueError, KeyError, TypeError):
        return False


@pytest.mark.parametrize("name", sampled(list(KINDS), 6))
def test_statistics_of_a_forged_folder_are_true_or_refused(whole: Path, tmp_path: Path, name: str) -> None:
    folder = victim(whole, tmp_path)
    KINDS[name](folder)
    attack(whole, folder, "stats", str(folder))


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if place % 4 == 0 else pytest.mark.attack) for place, name in enumerate(KINDS)]
)
def test_a_sweep_into_a_forged_folder_completes_it_or_refuses_it(whole: Path, tmp_path: Path, name: str) -> None:
    folder = victim(whole, tmp_path)
    KINDS[name](folder)
    attack(whole, folder, "sweep", str(folder.parent / "study.toml"), "--out", str(folder), "--workers", "1")


DAMAGED_ONLY = ("manifest missing", "manifest empty", "manifest cut off", "chunk empty", "chunk cut off")


@pytest.mark.parametrize("name", sampled(DAMAGED_ONLY, 3))
def test_what_is_only_damaged_is_mended(whole: Path, tmp_path: Path, name: str) -> None:
    folder = victim(whole, tmp_path)
    KINDS[name](folder)
    assert attack(whole, folder, "stats", str(folder)) == 0
    study = str(folder.parent / "study.toml")
    assert attack(whole, folder, "sweep", study, "--out", str(folder), "--workers", "1") == 0


def test_maps_of_strange_controllers_are_files_of_ours(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # all of these episodes end alike, which a sentence would say in place of a map
    monkeypatch.setattr(RobustnessMap, "constant", None)
    folder = victim(whole, tmp_path)
    KINDS["controllers with one file name"](folder)
    assert attack(whole, folder, "stats", str(folder)) == 0
    made = {path.name for path in (folder / "stats").iterdir() if not path.name.startswith("curve_")}
    assert made == {
        "stats.json",
        "report.html",
        "map_a_b.png",
        "map_a_b_2.png",
    }


@pytest.mark.attack
@pytest.mark.parametrize("command", ["sweep", "stats"])
def test_bytes_changed_at_random(whole: Path, tmp_path: Path, command: str) -> None:
    dice = random.Random(9)
    for number in range(200):
        folder = victim(whole, tmp_path / str(number))
        path = dice.choice([manifest_path(folder), chunk(folder), chunk(folder, 1), chunk(folder, 2)])
        content = bytearray(path.read_bytes())
        for _ in range(dice.choice([1, 1, 3, 30])):
            content[dice.randrange(len(content))] = dice.randrange(256)
        path.write_bytes(content[: dice.choice([len(content), len(content), dice.randrange(len(content))])])
        words = [str(folder)] if command == "stats" else [str(folder.parent / "study.toml"), "--out", str(folder)]
        attack(whole, folder, command, *words)
        shutil.rmtree(folder.parent)
