"""Every command that takes a controller takes FILE.py:make, with the file's digest in
what it writes.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path

import pytest

from skyarm.records.registry import plugins
from skyarm.scenario.scenario_file import LIBRARY
from skyarm.simulate import Log
from support.cases import sampled
from support.commands import refused, skyarm
from support.components import RESULTS, Mistake, registry_kept
from support.studies import drop_chunk

OWN = Path(__file__).parents[2] / "examples" / "own_law.py"
LAW = "own_law.py:make_lqr"
DIGEST = f"sha256:{hashlib.sha256(OWN.read_bytes()).hexdigest()}"

STUDY = """
schema = 1
name = "quick"
scenario = "case3"
controllers = ["paper_ct"]
duration = 0.5
episodes = 6
chunk = 3
[windows]
steady = [0.2, 0.5]
[vary]
"plant.vehicle.base.mass" = { uniform = [0.65, 0.75] }
"""

SHORT = """
schema = 1
name = "short"
duration = 1.0
[plant]
vehicle = "hummingbird_arm2_rotors"
[model]
vehicle = "hummingbird_arm2"
[controller]
preset = "paper_ct"
[reference]
base = { kind = "hover", position = [0.0, 0.0, 1.0] }
"""
SUITE = ["--only", "perfect"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    shutil.copy(OWN, tmp_path / "own_law.py")
    (tmp_path / "study.toml").write_text(STUDY)
    (tmp_path / "short.toml").write_text(SHORT)
    monkeypatch.chdir(tmp_path)
    with registry_kept():
        yield tmp_path


def anew() -> None:
    """As a process of its own would begin: nothing is loaded."""
    for held in (plugins._LOADED, plugins._MODULES):
        held.clear()
    from skyarm.records.registry.registrations import _FOUND

    for name in [name for name in _FOUND["law"] if ".py:" in name]:
        del _FOUND["law"][name]


def ran(*words: str):
    with registry_kept():
        anew()
        done = skyarm(*words)
    assert done.code == 0, done.err
    return done


def changed(folder: Path) -> None:
    text = (folder / "own_law.py").read_text()
    (folder / "own_law.py").write_text(
        text.replace("weight: float = 16.0", "weight: float = 9.0")
    )


def test_run_flies_it_on_both_plants(folder):
    for plant in ("rigid_body", "mujoco"):
        ran(
            "run",
            "case3",
            "--laws",
            LAW,
            "--plant",
            plant,
            "--duration",
            "1",
            "--out",
            plant,
        )
        (file,) = (folder / plant).glob("*.npz")
        log = Log.load_npz(file)
        assert (log.status, log.info["controller"]) == ("completed", "lqr")
        assert log.info["plugins"] == {"own_law.py": DIGEST}


@pytest.mark.parametrize(
    "ways", [("--workers", "1"), ("--workers", "2")], ids=["one", "two"]
)
def test_sweep_flies_it_beside_others_and_refuses_another_file(folder, ways):
    pytest.importorskip("pyarrow")
    from skyarm.studies.sweep.stats import Rows

    words = ["sweep", "study.toml", "--laws", LAW, "--laws", "paper_ct", *ways]
    assert "12 flights" in ran(*words).out
    drop_chunk(folder / "out" / "quick", 1)
    assert ", 6 were there" in ran(*words).out
    rows = Rows(folder / "out" / "quick")
    assert list(rows.manifest.scenarios) == [LAW, "paper_ct"]
    changed(folder)
    drop_chunk(folder / "out" / "quick", 1)
    before = {
        path: path.read_bytes()
        for path in (folder / "out" / "quick" / "rows").iterdir()
    }
    with registry_kept():
        anew()
        refused(skyarm(*words), "choose another --out", "own_law.py")
    assert {
        path: path.read_bytes()
        for path in (folder / "out" / "quick" / "rows").iterdir()
    } == before


@pytest.mark.parametrize(
    ("plant", "words", "at", "name"),
    [
        pytest.param(
            *("rigid_body", SUITE, ("perfect", "case1"), "make_lqr of own_law.py"),
            marks=pytest.mark.thorough,
        ),
        ("mujoco", ["short.toml"], ("given", "short"), LAW),
    ],
)
def test_compare_flies_it_beside_others_and_another_file_again(
    folder, plant, words, at, name
):
    """The suite in batches on our own plant; a scenario's flights one by one in
    processes in MuJoCo.
    """
    words = [
        "compare",
        *words,
        "--laws",
        f"paper_pd,{LAW}",
        "--plant",
        plant,
        "--workers",
        "2",
        "--out",
        "bench",
    ]
    ran(*words)
    found = json.loads((folder / "bench" / "results.json").read_text())
    assert found["plugins"] == {"own_law.py": DIGEST}
    summaries = found["summaries"][at[0]][at[1]]
    assert set(summaries) - {"own"} == {"paper_pd", name}
    assert summaries[name]["completed"] == 1
    assert name in (folder / "bench" / "tables.md").read_text()
    if at[0] == "perfect":  # only the suite has a report
        assert "user-defined laws" in (folder / "bench" / "report.html").read_text()
    kept = {
        path: path.stat().st_mtime_ns for path in (folder / "bench" / "rows").iterdir()
    }
    ran(*words)
    assert {
        path: path.stat().st_mtime_ns for path in (folder / "bench" / "rows").iterdir()
    } == kept
    changed(folder)
    with registry_kept():
        anew()
        ran(*words)
    again = {
        path.stat().st_mtime_ns for path in (folder / "bench" / "rows").iterdir()
    } - set(kept.values())
    assert again
    assert json.loads((folder / "bench" / "results.json").read_text())["plugins"] != {
        "own_law.py": DIGEST
    }


def test_margins_take_it(folder):
    ran("margins", "case3", "--laws", LAW, "--instants", "0", "--out", "margins.json")
    found = json.loads((folder / "margins.json").read_text())
    assert (found["controller"], found["plugins"]) == ("lqr", {"own_law.py": DIGEST})
    radii = [each["radius"] for each in found["instants"][0]["by_lag"].values()]
    assert all(0.9 < radius < 1.0 for radius in radii)


def test_export_c_takes_it_and_says_whose_it_is(folder):
    done = ran(
        "export", "--to", "c", LAW, "--vehicle", "hummingbird_arm2", "--out", "lqr.c"
    )
    assert "make_lqr_of_own_law_py_step, lqr for hummingbird_arm2" in done.out
    text = (folder / "lqr.c").read_text()
    assert f"own_law.py {DIGEST}" in text
    assert "make_lqr_of_own_law_py_step(" in text


def test_a_file_never_names_a_file(folder):
    """Not even one that the command line has loaded."""
    case = (LIBRARY / "case3.toml").read_text("utf-8")
    start, end = (
        case.index("[controller]"),
        case.index("[", case.index("[controller]") + 1),
    )
    (folder / "mine.toml").write_text(
        f'{case[:start]}[controller]\nlaw = "{LAW}"\n\n{case[end:]}'
    )
    words = (
        (
            "controller.law = 'own_law.py:make_lqr': must not be a file's; only --laws"
            " takes FILE.py:make"
        ),
    )
    refused(skyarm("run", "mine.toml"), *words)
    refused(skyarm("margins", "mine.toml", "--plugin", "own_law.py"), *words)
    (folder / "file.toml").write_text(STUDY.replace('"paper_ct"', f'"{LAW}"'))
    words = (
        (
            "controllers = 'own_law.py:make_lqr': must not be a file's; only --laws"
            " takes FILE.py:make"
        ),
    )
    refused(skyarm("sweep", "file.toml"), *words)
    refused(skyarm("sweep", "file.toml", "--laws", LAW), *words)


WORDS = {
    "run": ["run", "case1", "--duration", "0.5", "--laws"],
    "mujoco": ["run", "case1", "--duration", "0.5", "--plant", "mujoco", "--laws"],
    "sweep": ["sweep", "study.toml", "--workers", "2", "--laws"],
    "compare": ["compare", "--only", "perfect", "--workers", "2", "--laws"],
    "compare_mujoco": [
        "compare",
        "--only",
        "perfect",
        "--plant",
        "mujoco",
        "--workers",
        "2",
        "--laws",
    ],
    "margins": ["margins", "case1", "--instants", "0", "--laws"],
    "export_c": ["export", "--to", "c", "-o", "x.c", "--vehicle", "hummingbird_arm2"],
}
RAISES = Mistake(
    "def law(memory, seen, wanted, dt, *, par):\n    raise KeyError('no such gain')  #"
    " here\n",
    "",
)
TOLD = {
    "one_effort": (
        RESULTS["one_effort"],
        "law 'mine' gives 1 efforts: must be 2, one for each joint",
    ),
    "raises": (RAISES, "KeyError: 'no such gain'"),
}


@pytest.mark.parametrize("command", WORDS)
@pytest.mark.parametrize("name", sampled(list(TOLD), 3))
def test_a_wrong_law_is_one_line_and_exit_2_in_every_command(folder, command, name):
    mistake, words = TOLD[name]
    (folder / "mine.py").write_text(mistake.text)
    refused(skyarm(*WORDS[command], "mine.py:make"), f"mine.py:{mistake.line}: {words}")


def test_an_error_in_a_worker_process_is_one_line_too(folder):
    """A law that is called flies in processes; what it raises there has its file and
    line here.
    """
    body = (
        "def law(memory, seen, wanted, dt, *, par):\n    raise KeyError('no such gain')"
        "  # here\n"
    )
    make = Mistake(body, "").make.replace(
        "memory={memory}", "memory={memory}, compiled=False"
    )
    mistake = Mistake(body, "", make=make)
    (folder / "mine.py").write_text(mistake.text)
    words = ["compare", *SUITE, "--workers", "2", "--laws", "mine.py:make"]
    refused(skyarm(*words), f"mine.py:{mistake.line}: KeyError: 'no such gain'")


def test_an_error_of_a_maker_is_one_line(folder):
    text = "def make(model):\n    return [][0]\n"
    (folder / "mine.py").write_text(text)
    refused(
        skyarm("run", "case1", "--laws", "mine.py:make"),
        "mine.py:2: IndexError: list index out of range",
    )


@pytest.mark.thorough
def test_a_law_made_inside_a_function_flies_in_processes(folder):
    shutil.copy(OWN.parent / "servo_drive.py", folder / "servo.py")
    words = [
        "compare",
        "short.toml",
        "--workers",
        "2",
        "--plant",
        "mujoco",
        "--out",
        "bench",
    ]
    ran(*words, "--laws", "servo.py:make_angles")
    found = json.loads((folder / "bench" / "results.json").read_text())
    assert found["summaries"]["given"]["short"]["servo.py:make_angles"]["episodes"] == 1
