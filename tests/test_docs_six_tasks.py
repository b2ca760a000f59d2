"""The usual programs of the page on Python: each runs by itself, in twelve lines at
most, and does what it says.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

import skyarm

PAGE = Path(__file__).resolve().parents[1] / "docs" / "in_python.md"
TASKS = dict(
    re.findall(
        r"^## (.*?)\n.*?```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL | re.M
    )
)


@pytest.fixture
def ran(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Any:
    """Run a task in an empty folder: its names, and what it printed."""
    monkeypatch.chdir(tmp_path)

    def run(task: str) -> tuple[dict[str, Any], str]:
        names: dict[str, Any] = {}
        exec(compile(TASKS[task], "in_python.md", "exec"), names)
        return names, capsys.readouterr().out

    return run


def test_there_are_seven_of_twelve_lines_at_most() -> None:
    assert list(TASKS) == [
        "Build and run",
        "Plot",
        "Change",
        "Score",
        "Step",
        "Fly your own law",
        "Sweep",
    ]
    for name, code in TASKS.items():
        assert len([line for line in code.splitlines() if line.strip()]) <= 12, name


def test_build_and_run(ran: Any) -> None:
    names, told = ran("Build and run")
    assert told == "completed (1600, 3)\n"
    assert names["log"].info["controller"] == "centroidal_tip"


def test_change_the_wind(ran: Any) -> None:
    names, told = ran("Change")
    assert told.startswith("completed")
    assert names["log"].air_velocity[:, 0].max() == pytest.approx(3.0)


def test_a_law_of_ones_own(ran: Any) -> None:
    names, _ = ran("Fly your own law")
    log = skyarm.run(names["planned"])
    assert log.info["controller"] != "climber"
    speeds = names["law"](
        (),
        log_measurement(names["planned"]),
        names["planned"].reference.at(0.0),
        0.005,
        par=names["mine"].par,
    )[1].rotor_speeds
    assert len(set(speeds)) == 1


def log_measurement(planned: skyarm.Scenario) -> skyarm.Measurement:
    return skyarm.Session(planned).measurement


def test_step_it(ran: Any) -> None:
    names, told = ran("Step")
    assert names["log"].time.size == 600
    assert (names["log"].rotor_commands[200] == 490.0).all()
    assert "Vec3" in told


def test_look_at_it(ran: Any, tmp_path: Path) -> None:
    ran("Plot")
    assert (tmp_path / "tip.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "flight.csv").read_text().startswith("time [s],")


def test_score_it(ran: Any) -> None:
    _, told = ran("Score")
    found = {
        line.split(": ")[0]: float(line.split(": ")[1]) for line in told.splitlines()
    }
    assert list(found) == ["position_error_mean", "joint_error_max", "rotor_jitter"]
    assert 0.001 < found["position_error_mean"] < 0.2


def test_vary_it(ran: Any, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    names, told = ran("Sweep")
    rows = names["rows"]
    assert (rows.count, rows.complete) == (400, True)
    assert told.startswith("paper_ct ")
    # a load that nobody knows of sinks the paper's law, and the centroidal law learns
    # it
    ct, tip = (rows.of(law, "position_error_mean").mean() for law in rows.controllers)
    assert ct > 3.0 * tip
    again = skyarm.fly_sweep(names["study"], tmp_path / "out" / "payload")
    assert (again.of("paper_ct", "episode") == rows.of("paper_ct", "episode")).all()


def test_a_study_may_be_a_file_or_its_tables(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    fields = {
        "name": "two",
        "scenario": "case3",
        "controllers": ["paper_ct"],
        "duration": 0.2,
        "episodes": 2,
    }
    windows = {
        "steady": [0.1, 0.2],
        "transient": [0.0, 0.1],
        "gust": [0.1, 0.2],
        "hover": [0.0, 0.1],
    }
    tables = {"schema": 1, **fields, "windows": windows | {"holds": [], "last": 0.1}}
    file = tmp_path / "two.toml"
    file.write_text(
        'schema = 1\nname = "two"\nscenario = "case3"\ncontrollers ='
        ' ["paper_ct"]\nduration = 0.2\nepisodes = 2\n[windows]\nsteady = [0.1,'
        " 0.2]\ntransient = [0.0, 0.1]\ngust = [0.1, 0.2]\nhover = [0.0, 0.1]\nholds ="
        " []\nlast = 0.1\n",
        "utf-8",
    )
    first = skyarm.fly_sweep(tables, tmp_path / "out")
    # the same study, so that nothing is flown again
    second = skyarm.fly_sweep(str(file), tmp_path / "out")
    third = skyarm.fly_sweep(skyarm.load_study(file), tmp_path / "out", workers=2)
    assert first.count == second.count == third.count == 2
    with pytest.raises(
        skyarm.StudyError, match="episodes = 3: must be 2 as in the rows"
    ):
        skyarm.fly_sweep({**tables, "episodes": 3}, tmp_path / "out")


def test_no_public_function_bears_the_name_of_a_room() -> None:
    """``import skyarm.studies.sweep`` would put the room in its place."""
    rooms = {
        path.name for path in Path(skyarm.__file__).parent.iterdir() if path.is_dir()
    }
    taken = rooms & set(skyarm.__all__)
    assert all(not callable(getattr(skyarm, name)) for name in taken), taken


@pytest.mark.parametrize(
    "room", ["world", "studies", "log", "control", "reference", "view"]
)
def test_a_room_is_there_after_import(room: str) -> None:
    assert getattr(skyarm, room).__name__ == f"skyarm.{room}"
    import importlib

    importlib.import_module(f"skyarm.{room}")
    assert callable(skyarm.run)
    assert callable(skyarm.score)
