"""The page on logs: its commands and its Python run, its topics are those that are
written.
"""

from __future__ import annotations

import re
import shlex
import sys
from functools import cache
from pathlib import Path

import pytest

import skyarm
from skyarm.cli.main import main
from skyarm.log.ros.messages import full_name
from skyarm.log.ros.pictures import FLAT, ROUND
from skyarm.log.ros.topics import FlightTopics
from support.flights import COMPASS, GPS, estimated
from support.logs import flown
from support.worlds import touching

PAGE = (Path(__file__).resolve().parents[1] / "docs" / "logs.md").read_text("utf-8")
COMMANDS = [
    line.split("#")[0].strip()
    for line in PAGE.splitlines()
    if line.startswith("skyarm ")
]


def test_every_command_shown_runs_one_after_the_other(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert len(COMMANDS) == 3
    for line in COMMANDS:
        monkeypatch.setattr(sys, "argv", shlex.split(line))
        with pytest.raises(SystemExit) as ended:
            main()
        assert not ended.value.code, (line, capsys.readouterr().err)
    assert {"flight.mcap", "flight.csv"} <= {p.name for p in tmp_path.iterdir()}


def test_the_python_shown_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    codes = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert len(codes) == 2
    names: dict[str, object] = {}
    for code in codes:
        exec(compile(code, "logs.md", "exec"), names)
    lines = capsys.readouterr().out.splitlines()
    assert lines == [
        "completed (2400, 3) m, position of the tip, world axes",
        "completed (12000, 3)",
    ]
    assert Path("path.png").stat().st_size > 20_000


def test_the_topics_shown_are_those_that_are_written():
    (table,) = re.findall(
        r"<!-- topics; .*?-->\n(.*?)<!-- /topics -->", PAGE, re.DOTALL
    )
    rows = [
        [cell.strip().strip("`") for cell in line.strip("|").split("|")]
        for line in table.strip().splitlines()[2:]
    ]
    words = {0: "once", 1: "200", 4: "50"}
    written = {
        each.name: (
            full_name(each.kind),
            (
                "control"
                if each.name in ("/clock", "/skyarm/flight")
                else words[each.every]
            ),
        )
        for log in (flown(), touching(), on_a_filter())
        for each in FlightTopics(log).topics
        if not each.name.startswith("/sensors/")
    }
    assert {name: (kind, rate) for name, kind, rate, _ in rows} == written


def test_the_topics_of_pictures_shown_are_those_that_are_written():
    (table,) = re.findall(
        r"<!-- pictures; .*?-->\n(.*?)<!-- /pictures -->", PAGE, re.DOTALL
    )
    rows = [
        [cell.strip().strip("`") for cell in line.strip("|").split("|")][:2]
        for line in table.strip().splitlines()[2:]
    ]
    written = {f"/{last}": kind for last, (kind, _) in (FLAT | ROUND).items()}
    assert dict(rows) == {name: full_name(kind) for name, kind in written.items()}


@cache
def on_a_filter() -> skyarm.Log:
    wrist = {"kind": "force_torque"}
    sensors = {
        "sensors__gps": GPS,
        "sensors__compass": COMPASS,
        "sensors__wrist": wrist,
    }
    return skyarm.run(estimated(duration=0.1, **sensors))


def test_the_messages_of_readings_shown_are_those_that_are_written():
    (table,) = re.findall(
        r"<!-- readings; .*?-->\n(.*?)<!-- /readings -->", PAGE, re.DOTALL
    )
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in table.strip().splitlines()[2:]
    ]
    log = on_a_filter()
    written = {each.name: full_name(each.kind) for each in FlightTopics(log).topics}
    seen = set()
    for name, fields in log.readings.items():
        words = ", ".join(f"`{field}`" for field in fields if field != "time")
        row = next((row for row in rows if row[0] == words), rows[-1])
        assert row[1].partition(":")[0] == f"`{written[f'/sensors/{name}']}`", name
        seen.add(row[0])
    assert seen == {row[0] for row in rows}


def test_the_formats_shown_are_those_there_are():
    from skyarm.records.registry import names

    shown = re.findall(r"^\| `\.(\w+)` \|.*\| (yes|no) \|", PAGE, re.MULTILINE)
    read = {kind for kind, back in shown if back == "yes"}
    from skyarm.log.formats import require_format

    assert {kind for kind, _ in shown} == {
        kind for kind in names("log_format") if require_format(f"a.{kind}").read
    } | {
        "csv",
    }
    assert read == {
        kind for kind, _ in shown if require_format(f"a.{kind}").read is not None
    }
