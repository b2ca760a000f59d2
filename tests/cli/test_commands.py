"""The commands as a shell runs them."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command_files import succeeded

import skyarm
from skyarm.control.catalogue import LAWS, PRESETS
from skyarm.records.files.earlier_files import earlier_kept
from skyarm.scenario.scenario_file import list_scenarios
from skyarm.simulate import Log
from skyarm.studies.sweep import list_studies
from skyarm.vehicle.vehicle_files import LIBRARY as VEHICLES
from skyarm.vehicle.vehicle_files import list_vehicles
from support.cases import sampled
from support.commands import Outcome
from support.commands import skyarm as typed
from support.components import registry_kept

COMMAND = [sys.executable, "-W", "error", "-m", "skyarm"]


def shell(*arguments: str, cwd: Path | None = None) -> Outcome:
    """As a process of its own."""
    done = subprocess.run(
        [*COMMAND, *arguments],
        capture_output=True,
        text=True,
        cwd=cwd,
        timeout=120,
        check=False,
    )
    return Outcome(done.returncode, done.stdout, done.stderr)


def test_values_that_need_no_conversion_load_no_library_that_converts() -> None:
    program = "import sys; from skyarm.cli.main import main; main()"
    watched = program.replace(
        "main()",
        "sys.exit = lambda code: print(code, 'pydantic' in sys.modules); main()",
    )
    done = subprocess.run(
        [sys.executable, "-c", watched, "check", "case1", "--quiet"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == ["0", "False"]


def test_the_version_is_printed() -> None:
    assert succeeded(shell("--version")).strip() == skyarm.__version__


@pytest.mark.parametrize("arguments", [["--help"], []])
def test_help_names_every_command(arguments: list[str]) -> None:
    text = succeeded(typed(*arguments))
    for command in ("reproduce", "run", "show"):
        assert re.search(rf"^  {command} ", text, re.MULTILINE)
    assert "..." not in text.split("Vehicles:")[1], "summaries fit on their lines"


@pytest.mark.parametrize("command", ["reproduce", "run", "show"])
def test_every_command_has_help(command: str) -> None:
    assert "Usage:" in succeeded(typed(command, "--help"))


def test_list_names_everything_shipped() -> None:
    text = succeeded(typed("show"))
    for name in (*list_vehicles(), *list_scenarios(), *list_studies(), *PRESETS, *LAWS):
        assert re.search(rf"\b{name}\b", text), name
    assert "hummingbird_arm2 (model only)" in text


def test_show_prints_the_paper_s_vehicle() -> None:
    text = succeeded(typed("show", "hummingbird_arm2_rotors", "--gravity", "9.8"))
    assert "0.82103 kg" in text
    assert "g = 9.8 m/s^2" in text
    assert "0.3 m" in text
    # faults and payloads name them
    assert re.search(r"^rotors +front, left, back, right *$", text, re.MULTILINE)
    assert re.search(r"^frames +tip \(end effector\) *$", text, re.MULTILINE)
    # both links horizontal: (0.045 0.075 + 0.045 0.225 + 0.005 0.3) 9.8 N m, see
    # test_workspace
    assert re.search(
        r"static effort of joint1 +0\.147 N m, limit 0\.5 N m, margin 3\.4", text
    )
    assert re.search(r"static efforts +for a level base", text)
    speed = float(re.search(r"hover rotor speed +([0-9.]+) rad/s", text)[1])  # type: ignore[index]
    assert speed == pytest.approx((0.82103 * 9.8 / 4 / 8.54858e-6) ** 0.5, abs=0.01)


def test_the_words_of_a_file_are_a_line_each_in_a_pipe() -> None:
    lines = succeeded(shell("show", "words")).splitlines()
    (rates,) = (line.split(" | ") for line in lines if line.startswith("rates.physics"))
    assert rates[:5] == [
        "rates.physics",
        "",
        "whole number",
        "Hz",
        "at least 1, at most 1e+06",
    ]
    assert {line.count(" | ") for line in lines} == {6}


def test_show_prints_the_servos_that_turn_rotors() -> None:
    text = succeeded(typed("show", "voliro_like"))
    assert re.search(r"^rotor4 +-0\.5 -0\.866025 0 *$", text, re.MULTILINE)
    assert "servos" not in succeeded(typed("show", "tilted_hexarotor"))
    facts = json.loads(succeeded(typed("show", "voliro_like", "--json")))["tilts"]
    assert facts["rotor3"]["axis"] == [-1.0, 0.0, 0.0]
    assert facts["rotor3"]["max_rate"] == 6.0


@pytest.mark.parametrize(
    ("vehicle", "columns"),
    [(name, 80) for name in list_vehicles()]
    + [("octo_coaxial_two_arms", n) for n in (40, 200)],
)
def test_every_shipped_vehicle_is_shown_on_any_terminal(
    vehicle: str, columns: int
) -> None:
    text = succeeded(typed("show", vehicle, columns=columns))
    assert text.splitlines()[0].startswith(vehicle)
    assert "e-1" not in text, "rounding errors of zero are shown as 0"


def test_a_reach_that_is_not_known_is_not_a_number(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    library = Path(str(VEHICLES))
    bare = (
        (library / "hummingbird_arm2_rotors.toml")
        .read_text()
        .replace('end_effector = "tip"', "")
    )
    assert bare != (library / "hummingbird_arm2_rotors.toml").read_text()
    (tmp_path / "bare.toml").write_text(bare)
    text = succeeded(typed("show", "bare.toml"))
    assert re.search(r"arm reach .*no end effector", text)
    assert "0 m" not in re.search("arm reach.*", text)[0]  # type: ignore[index]


def test_a_terminal_does_not_obey_the_names_in_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    named = (Path(str(VEHICLES)) / "hummingbird.toml").read_text()
    named = re.sub(
        '(?m)^name = "hummingbird"', r'name = "a\\u001b[31mb\\u202ec"', named
    )
    (tmp_path / "red.toml").write_text(named)
    assert succeeded(typed("show", "red.toml")).startswith(r"a\x1b[31mb\u202ec, g = ")
    (tmp_path / "worse.toml").write_text(named.replace("mass = ", "mass = -"))
    result = typed("run", "x\x1b]0;title\x07.toml")
    assert result.code == 2
    assert r"x\x1b]0;title\x07.toml" in result.err
    assert "\x1b" not in result.err


def test_square_brackets_of_a_source_are_printed_as_they_stand() -> None:
    assert "[s sin a, -s cos a, cos 30 deg]" in succeeded(
        typed("show", "tilted_hexarotor", columns=200)
    )


def test_run_writes_the_log_and_prints_what_came_out(tmp_path: Path) -> None:
    text = succeeded(
        shell(
            "run",
            "case3",
            "--duration",
            "1",
            "--seed",
            "3",
            "--out",
            "made/here",
            cwd=tmp_path,
        )
    )
    lines = text.splitlines()
    assert lines[0] == "case3: completed, 1 s"
    assert (
        lines[1]
        == "law hybrid_computed_torque on hummingbird_arm2_rotors, plant rigid_body"
        " (rk4), seed 3"
    )
    assert (
        " ".join(lines[2].split()) == "error, 0.3333 to 1 s mean max max, whole flight"
    )
    assert "made/here/case3.npz" in lines[-1]
    log = Log.load_npz(tmp_path / "made" / "here" / "case3.npz")
    assert (log.info["seed"], log.time.size) == (3, 200)
    assert sorted(p.name for p in (tmp_path / "made" / "here").iterdir()) == [
        "case3.csv",
        "case3.npz",
    ]
    position = next(line for line in lines if line.startswith("base, mm")).split()
    norm = 1e3 * np.linalg.norm(log.position - log.position_reference, axis=1)
    assert float(position[-1]) == pytest.approx(norm.max(), rel=1e-3)
    assert float(position[-3]) == pytest.approx(
        norm[log.time >= 1 / 3].mean(), rel=1e-3
    )


STEADY = """
[windows]
steady = [0.2, 0.3]
"""


def test_run_sums_up_over_the_scenario_s_own_window(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    low = LOW.replace("0.1]", "1.0]") + STEADY
    (tmp_path / "low.toml").write_text(low)
    lines = succeeded(typed("run", "low.toml", "--laws", "indi")).splitlines()
    assert lines[1].startswith("law indi on hummingbird_arm2_rotors, ")
    log = Log.load_npz(tmp_path / "out" / "run" / "low.npz")
    norm = 1e3 * np.linalg.norm(log.position - log.position_reference, axis=1)[40:60]
    assert lines[2].startswith("error, 0.2 to 0.3 s")
    position = next(line for line in lines if line.startswith("base, mm")).split()
    assert float(position[-3]) == pytest.approx(norm.mean(), rel=1e-3)
    assert float(position[-2]) == pytest.approx(norm.max(), rel=1e-3)


def test_the_centroidal_law_shows_what_the_readme_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The tip of Case 3 stays within a millimetre; in the last third of the flight its
    reference jumps.
    """
    monkeypatch.chdir(tmp_path)
    lines = succeeded(typed("run", "case3", "--laws", "centroidal_tip")).splitlines()
    mean, largest, whole = next(
        line for line in lines if line.startswith("tip, mm")
    ).split()[-3:]
    assert float(mean) < float(largest) < 1.0
    assert float(whole) > 100.0


def test_the_log_of_an_earlier_flight_keeps_a_number(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The newest has the plain name; --force replaces it."""
    monkeypatch.chdir(tmp_path)
    words = ("run", "case1", "--duration", "0.1", "--out", ".")
    for seed, more in ((1, ()), (2, ()), (3, ()), (4, ("--force",))):
        text = succeeded(typed(*words, "--seed", str(seed), *more))
        assert ("what was there is kept" in text) == (seed in (2, 3)), text
    seeds = {p.name: Log.load_npz(p).info["seed"] for p in tmp_path.glob("*.npz")}
    assert seeds == {"case1.npz": 4, "case1_1.npz": 1, "case1_2.npz": 2}
    assert sorted(p.name for p in tmp_path.glob("*.csv")) == [
        "case1.csv",
        "case1_1.csv",
        "case1_2.csv",
    ]


def test_numbers_that_are_taken_are_left_and_links_stay(tmp_path: Path) -> None:
    a, b = tmp_path / "a.npz", tmp_path / "a.csv"
    for file in (a, tmp_path / "a_1.csv", tmp_path / "real"):
        file.write_text(file.name)
    b.symlink_to(tmp_path / "real")
    with earlier_kept([a, b]) as kept:
        assert kept == [tmp_path / "a_2.npz"]
    assert (tmp_path / "a_2.npz").read_text() == "a.npz"
    assert (tmp_path / "a_1.csv").read_text() == "a_1.csv"
    assert b.is_symlink()
    with earlier_kept([a, b]) as kept:
        assert kept == []


def test_plugins_that_flew_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    plugin = Path(__file__).resolve().parents[2] / "examples" / "own_metric.py"
    words = ("run", "case1", "--duration", "0.1", "--plugin", str(plugin))
    with registry_kept():
        assert (
            succeeded(typed(*words))
            .splitlines()[1]
            .endswith(", seed 0, plugins own_metric.py")
        )


def test_run_chooses_plant_and_controller(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    typed(
        "run", "case1", "--duration", "0.1", "--plant", "mujoco", "--laws", "paper_pd"
    )
    log = Log.load_npz(tmp_path / "out" / "run" / "case1.npz")
    assert (log.info["plant"], log.info["controller"]) == ("mujoco", "decoupled_pd")


LOW = (
    'name = "low"\nduration = 1.0\n[plant]\nvehicle ='
    ' "hummingbird_arm2_rotors"\n[model]\nvehicle ='
    ' "hummingbird_arm2"\n[controller]\npreset = "paper_ct"\n[reference.base]\nkind ='
    ' "hover"\nposition = [0, 0, 0.1]\n'
)


def test_a_flight_that_ends_early_is_a_result_with_its_cause(tmp_path: Path) -> None:
    (tmp_path / "low.toml").write_text(LOW)
    result = shell("run", "low.toml", cwd=tmp_path)
    assert result.out.startswith("low: ground, 0 s of 1 s: lowest point at z = -0.2 m")
    assert result.err == ""
    assert result.code == 3, "a script that flies must notice"
    assert Log.load_npz(tmp_path / "out" / "run" / "low.npz").status == "ground"
    assert re.search(
        r"(?s)Exit\s+code\s+3:\s+ended\s+early", succeeded(typed("run", "--help"))
    )


@pytest.mark.parametrize(
    "words", [("show",), ("show", "--json")], ids=["by Rich", "by Typer"]
)
def test_a_reader_that_leaves_is_no_error(words: tuple[str, ...]) -> None:
    with subprocess.Popen(
        [*COMMAND, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        errors = process.stderr.read().decode()
        process.wait(timeout=60)
    # as a shell reports SIGPIPE; 1 is a fault that was found
    assert (errors, process.returncode) == ("", 141)


@pytest.mark.skipif(sys.platform == "win32", reason="shell redirections of POSIX")
@pytest.mark.parametrize(
    "redirect", sampled([">&-", "2>&-", ">/dev/null </dev/null"], 3)
)
def test_closed_streams_are_no_error(redirect: str) -> None:
    command = " ".join(f"'{part}'" for part in [*COMMAND, "show"])
    result = subprocess.run(
        f"{command} {redirect}",
        shell=True,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert result.returncode == 0
    assert result.stderr == ""


@pytest.mark.skipif(
    not Path("/dev/full").exists(), reason="no device that is always full"
)
def test_a_full_disk_under_standard_output_is_one_line() -> None:
    command = " ".join(f"'{part}'" for part in [*COMMAND, "show"])
    result = subprocess.run(
        f"{command} >/dev/full",
        shell=True,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert result.returncode == 2
    assert (
        result.stderr
        == "skyarm: standard output: must be usable (No space left on device)\n"
    )
