"""``skyarm margins`` as a user types it."""

from __future__ import annotations

import functools
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

from skyarm.cli import margins_command
from skyarm.cli.output import bar
from skyarm.scenario.scenario_file import load_scenario
from skyarm.studies.stability.flight_margins import evidence
from support.commands import refused, skyarm
from support.components import registry_kept

SHORT = """
schema = 1
name = "short"
duration = 1.0
[plant]
vehicle = "hummingbird_arm2_rotors"
gravity = 9.81
[model]
vehicle = "hummingbird_arm2"
[controller]
preset = "paper_pd"
[reference]
base = { kind = "hover", position = [0.0, 0.0, 1.0] }
joints = [0.0, 0.0]
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "short.toml").write_text(SHORT)
    return tmp_path


def test_margins_are_printed_and_written(folder: Path) -> None:
    """Their digits within 78 columns."""
    ended = skyarm(
        "margins",
        "short.toml",
        "--laws",
        "paper_ct",
        "--instants",
        "1",
        "--out",
        "m.json",
    )
    assert ended.code == 0, ended.err
    assert "hybrid_computed_torque in short" in ended.out
    assert "hover" in ended.out
    found = json.loads((folder / "m.json").read_text())
    assert (found["schema"], found["controller"], found["completed"]) == (
        1,
        "hybrid_computed_torque",
        True,
    )
    assert [each["hover"] for each in found["instants"]] == [True, False]
    lag = found["instants"][0]["by_lag"]["up"]
    assert 0.02 < lag["delay"] < 0.06
    assert lag["radius"] == pytest.approx(
        max(abs(complex(*z)) for z in lag["z"]), rel=1e-12
    )
    lines = ended.out.splitlines()
    assert max(len(line) for line in lines) <= 78
    head, hover, flying = (line.split() for line in lines[1:4])
    assert head[:5] == ["at", "max", "|z|", "slowest", "damping"]
    assert (hover[0], flying[:2]) == ("hover", ["0.99", "s"])
    lag = found["instants"][0]["by_lag"]
    assert hover[1] == f"{max(each['radius'] for each in lag.values()):.6f}"
    low = max(each["rotor_gain"][0] for each in lag.values())
    high = min(each["rotor_gain"][1] for each in lag.values())
    assert hover[5] == f"{low:.2f}-{high:.1f}"
    least = min(each["swings"] for each in found["instants"])
    assert (
        f"small swings grow in flight from {1e3 * least:.3g} ms of further dead time on"
        in ended.out
    )
    head, *rows = ended.out.split("\n\n")[1].splitlines()
    assert head.split() == [
        "weakest",
        "loop",
        "disk",
        "gain",
        "phase",
        "rad/s",
        "delay",
        "together",
    ]
    every = [
        one
        for each in found["instants"]
        for lag in each["by_lag"].values()
        for one in lag["loops"]
    ]
    joints = min(
        (one for one in every if one["group"] == "joints"), key=lambda one: one["disk"]
    )
    (row,) = [row for row in rows if row.startswith(joints["name"])]
    disk = joints["disk"]
    low, high, phase = (
        (2.0 - disk) / (2.0 + disk),
        (2.0 + disk) / (2.0 - disk),
        2.0 * math.degrees(math.atan(0.5 * disk)),
    )
    assert f"{joints['disk']:.2f} {low:.2f}-{high:.2f}" in row
    assert f" {phase:.0f} " in row


def test_margins_say_which_weather_of_ones_own_they_leave_out(folder: Path) -> None:
    air = '[[environment.air]]\nkind = "gusty"\nsigma = 2.0\n'
    wind = '[environment.wind]\nmode = "moving_air"\nvelocity = [2.0, 0.0, 0.0]\n'
    wind += "turbulence = { altitude = 6.0, wind_20ft = 7.7 }\n"
    (folder / "gusty.toml").write_text(SHORT + air + wind)
    plugin = ("--plugin", str(Path(__file__).parents[2] / "examples" / "own_wind.py"))
    options = ("--instants", "0", "--out", "m.json", "--html", "m.html")
    with registry_kept():
        ended = skyarm("margins", "gusty.toml", *plugin, *options)
    assert ended.code == 0, ended.err
    named = ["environment.wind.turbulence", "environment.air[0] = Gusty"]
    said = f"disturbances are left out: {', '.join(named)}"
    assert said in ended.out.splitlines()
    assert said in (folder / "m.html").read_text()
    found = json.loads((folder / "m.json").read_text())
    assert found["left_out"] == named
    calm = skyarm("margins", "short.toml", *options)
    assert "disturbances" not in calm.out
    assert (
        json.loads((folder / "m.json").read_text())["instants"] == found["instants"]
    ), "both hover in calm air"


def test_a_page_of_margins_ends_with_html(folder: Path) -> None:
    ended = skyarm(
        "margins",
        "short.toml",
        "--instants",
        "0",
        "--out",
        "new/m.json",
        "--html",
        "m.pdf",
    )
    assert (ended.code, ended.out, ended.err) == (
        2,
        "",
        "skyarm: --html = 'm.pdf': must end in .html\n",
    )
    assert not (folder / "new").exists()


def test_margins_say_how_far_they_are(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert folder.exists()
    told: list[tuple[int, int]] = []
    scenario = load_scenario("short.toml")
    evidence(scenario, 2, lambda done, total: told.append((done, total)))
    assert told == [(0, 3), (1, 3), (2, 3), (3, 3)]
    monkeypatch.setattr(margins_command, "bar", functools.partial(bar, pause=0.0))
    ended = skyarm("margins", "short.toml", "--instants", "2")
    assert ended.err.splitlines() == [
        f"skyarm: short: {done} of 3 instants" for done in range(4)
    ]


ARM6 = """
schema = 1
name = "arm6"
duration = 2.0
[plant]
vehicle = "hexarotor_arm6"
[controller]
preset = "centroidal_tip"
[reference]
base = { kind = "hover", position = [0.0, 0.0, 1.5] }
joints = [0.2, 0.3, 0.3, 0.0, 0.2, 0.0]
"""


@pytest.mark.thorough
def test_margins_of_a_six_joint_arm_are_told(folder: Path) -> None:
    (folder / "arm6.toml").write_text(ARM6)
    ended = skyarm("margins", "arm6.toml", "--instants", "1")
    assert ended.code == 0, ended.err
    assert "2.00 s" in ended.out


def test_the_command_line_keeps_blas_to_one_thread_and_leaves_what_the_user_set() -> (
    None
):
    code = (
        "import os, sys; sys.argv = ['skyarm', '--version']; from skyarm.cli.main"
        " import main\n"
    )
    code += (
        "try: main()\nexcept SystemExit: print('numpy' in sys.modules,"
        " os.environ['OPENBLAS_NUM_THREADS'])"
    )
    for given, kept in (({}, "1"), ({"OPENBLAS_NUM_THREADS": "3"}, "3")):
        plain = {
            name: value
            for name, value in os.environ.items()
            if not name.endswith("_NUM_THREADS")
        }
        done = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            check=True,
            env=plain | given,
        )
        assert done.stdout.split()[-1] == kept
    code = "import sys, skyarm.cli.main; print('numpy' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "False", "the variables would come too late"


def test_wrong_words_are_one_line(folder: Path) -> None:
    assert folder.exists()
    refused(
        skyarm("margins", "short.toml", "--laws", "best"),
        "--laws = 'best': must be a preset",
    )
    refused(
        skyarm("margins", "short.toml", "--instants", "-1"),
        "instants = -1: must be from 0 to 10000",
    )


@pytest.mark.thorough
def test_the_margins_of_the_centroidal_law_hold_its_slow_adaptation(
    folder: Path,
) -> None:
    ended = skyarm(
        "margins",
        "case3",
        "--laws",
        "centroidal_tip",
        "--instants",
        "1",
        "--out",
        "m.json",
    )
    assert ended.code == 0, ended.err
    assert "adaptation of load and friction is held" in ended.out
    found = json.loads((folder / "m.json").read_text())
    radii = [
        lag["radius"]
        for instant in found["instants"]
        for lag in instant["by_lag"].values()
    ]
    assert max(radii) < 1.0


@pytest.mark.thorough
def test_a_scenario_s_own_guard_stays_and_is_not_put_on_twice(folder: Path) -> None:
    (folder / "guarded.toml").write_text(
        SHORT.replace('"paper_pd"', '"paper_pd"\nsafety = true')
    )
    for words in ([], ["--safety"]):
        ended = skyarm(
            "margins", "guarded.toml", "--laws", "paper_pd", "--instants", "0", *words
        )
        assert ended.code == 0, ended.err
        assert ended.out.startswith("guarded_decoupled_pd in short")


def test_too_many_instants_are_refused(folder: Path) -> None:
    assert folder.exists()
    refused(
        skyarm("margins", "case3", "--instants", "10000000000"),
        "--instants = 10000000000: must be from 0",
    )
