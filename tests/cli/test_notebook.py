"""Records in a notebook: the lines of the command that prints them, a picture, and the
text alone where both fail.
"""

from __future__ import annotations

import dataclasses
import html
import re
from collections.abc import Callable
from typing import Any

import pytest

import skyarm
from skyarm.cli import notebook
from skyarm.cli.main import main
from skyarm.cli.output import tell
from skyarm.log.flight_summary import facts, summary
from skyarm.studies.assess.assessment import Assessment
from skyarm.studies.assess.finding import OK, Finding

PICTURE = re.compile(r'<figure><img alt="\w+" src="data:image/png;base64,[\w+/=]+">')


@pytest.fixture(scope="module")
def log() -> skyarm.Log:
    return skyarm.run(
        skyarm.load_scenario("case1", controller="paper_pd", duration=0.05)
    )


class Drawn:
    """Stand-in for a figure: the real ones take a second."""

    def _repr_png_(self) -> bytes:
        return b"\x89PNG"


@pytest.fixture
def quickly_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    for kind, (lines, draw) in notebook.SHOWN.items():
        monkeypatch.setitem(notebook.SHOWN, kind, (lines, draw and (lambda _: Drawn())))


def words_of(record: Any) -> list[str]:
    """Lines of the text of a record's HTML."""
    (text,) = re.findall("<pre>(.*?)</pre>", record._repr_html_(), re.DOTALL)
    return [line.rstrip() for line in html.unescape(text).splitlines()]


def test_a_log_shows_the_table_that_run_prints_and_a_figure(
    log: skyarm.Log, capsys: pytest.CaptureFixture[str], quickly_drawn: None
) -> None:
    tell(*summary(log, facts(log)))
    assert words_of(log) == [
        line.rstrip() for line in capsys.readouterr().out.splitlines()
    ]
    assert words_of(log)[0] == "case1: completed, 0.05 s"
    assert any(re.match(r"base, mm( +[\d.e-]+){3}$", line) for line in words_of(log))
    assert PICTURE.search(log._repr_html_())


@pytest.mark.thorough
def test_the_command_prints_what_a_log_shows(
    log: skyarm.Log,
    tmp_path: Any,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    log.save_npz(tmp_path / "flown.npz")
    monkeypatch.setattr(
        "sys.argv",
        ["skyarm", "run", f"{tmp_path}/flown.npz", "--log", f"{tmp_path}/again.npz"],
    )
    with pytest.raises(SystemExit):
        main()
    printed = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    assert words_of(log) == [
        line for line in printed if not line.startswith(("log: ", "picture: "))
    ]


def test_a_scenario_a_vehicle_and_a_check_show_their_lines(
    log: skyarm.Log, quickly_drawn: None
) -> None:
    scenario = log.scenario
    lines = dict(line.split(maxsplit=1) for line in words_of(scenario)[1:])
    assert (lines["vehicle"], lines["law"]) == (
        scenario.plant.vehicle.name,
        "decoupled_pd",
    )
    assert lines["duration"] == "0.05 s, control at 200 Hz, seed 0"
    fault = skyarm.Fault(rotor="front", effectiveness=0.9, start=0.0)
    assert "faults    Fault" in words_of(dataclasses.replace(scenario, faults=(fault,)))
    vehicle = skyarm.load_vehicle("hummingbird")
    assert any(line.startswith("thrust margin ") for line in words_of(vehicle))
    assert PICTURE.search(scenario._repr_html_())
    assert PICTURE.search(vehicle._repr_html_())
    found = Assessment(
        "mine", vehicle, 9.81, 0.0, 16, (Finding("units", OK, "all likely"),)
    )
    assert words_of(found)[-1] == "can fly: no fault, 0 warnings"
    assert "<img" not in found._repr_html_()


@pytest.mark.thorough
def test_logs_vehicles_and_scenarios_are_drawn(log: skyarm.Log) -> None:
    for record in (log, log.scenario, log.scenario.plant.vehicle):
        assert len(notebook.words_and_picture(record)[1]) > 10_000


def test_names_from_files_are_text_and_nothing_else(
    log: skyarm.Log, quickly_drawn: None
) -> None:
    hostile = "<script>alert(1)</script>\x1b[31m"
    renamed = dataclasses.replace(
        log, info={**log.info, "scenario": hostile, "controller": hostile}
    )
    for record in (renamed, dataclasses.replace(log.scenario, title=hostile)):
        shown = record._repr_html_()
        assert "<script" not in shown
        assert "\x1b" not in shown
        assert "&lt;script&gt;alert(1)" in shown


def broken(_: Any) -> Any:
    """Function that has no result."""
    raise RuntimeError("no figures here")


@pytest.mark.parametrize("kind", [skyarm.Log, skyarm.Scenario])
def test_without_a_picture_the_lines_stay_and_without_lines_the_text(
    kind: type, log: skyarm.Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    record: Any = log if kind is skyarm.Log else log.scenario
    lines: Callable[[Any], Any] = notebook.SHOWN[kind][0]
    monkeypatch.setitem(notebook.SHOWN, kind, (lines, broken))
    assert "<img" not in record._repr_html_()
    assert len(words_of(record)) > 3
    monkeypatch.setitem(notebook.SHOWN, kind, (broken, None))
    assert record._repr_html_() == f"<pre>{html.escape(repr(record))}</pre>"


def test_a_damaged_log_shows_what_there_is(log: skyarm.Log) -> None:
    damaged = dataclasses.replace(log, info={"scenario": "mine"})
    assert "scenario=&#x27;mine&#x27;" in damaged._repr_html_()
