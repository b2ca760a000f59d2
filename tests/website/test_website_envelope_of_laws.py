"""The envelope that docs/data/results_envelope.md shows is what flights give; ``make
envelope`` writes it anew.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from envelope_of_laws import (
    FIRST,
    PAGE,
    PICTURE,
    REST,
    ROOT,
    TABLES,
    marks,
    table,
    value_of,
    written,
)
from envelope_rules import FLAGSHIP

from skyarm.studies.compare.envelope import Envelope, summary_rows
from support.studies import cell_of

TEXT = (ROOT / PAGE).read_text("utf-8")
FLOWN = ("circle", "payload")
"""Axes that the test flies; more would take a minute."""


def shown():
    """Tables of the page by their headings, each as lines."""
    text = "".join(
        block for name in (FIRST, REST) for block in marks(name).findall(TEXT)
    )
    parts = re.split(r"^### (.*)\n\n", text, flags=re.M)[1:]
    return {
        title: re.findall(r"^\|.*\|$", part, re.M)
        for title, part in zip(parts[::2], parts[1::2], strict=True)
    }


def cells(line):
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_the_page_shows_what_flights_give():
    envelope = Envelope(laws=("paper_ct", FLAGSHIP), axes=FLOWN)
    todo, refused = envelope.plan_cells()
    found = envelope.judge([(each, cell_of(each)) for each in todo], refused)
    rows = summary_rows(found["axes"], envelope.laws)
    assert len(rows) == len(FLOWN)
    for title, group in TABLES.items():
        head, _, *lines = shown()[title]
        page = {cells(line)[0]: cells(line) for line in lines}
        for line in table(rows, group, envelope.laws).splitlines()[2:]:
            trial, *flown = cells(line)
            kept = [page[trial][cells(head).index(law)] for law in envelope.laws]
            assert kept == flown, (
                f"{trial}, {title}: 'make envelope' writes the tables anew"
            )


def test_every_axis_and_law_stands_in_it():
    from skyarm.studies.compare.envelope_axes import AXES

    assert list(shown()) == list(TABLES)
    for head, _, *lines in shown().values():
        assert len(lines) == len(AXES)
        assert {"paper_ct", FLAGSHIP} <= set(cells(head))
    sheet = (ROOT / "docs" / "results_envelope.md").read_text("utf-8")
    assert f"]({PICTURE.removeprefix('docs/')})" in sheet
    assert "](docs/results_envelope.md)" in (ROOT / "README.md").read_text("utf-8")
    assert (ROOT / PICTURE).stat().st_size <= 5e5


def test_the_values_of_every_axis_stand_on_the_page():
    from skyarm.studies.compare.envelope_axes import AXES

    part = TEXT.partition("## Trials\n")[2].partition("\n## ")[0]
    _, _, *lines = re.findall(r"^\|.*\|$", part, re.M)
    rows = {
        name.strip("`"): [unit, *(float(each) for each in values.split(", "))]
        for name, _, values, unit, _ in map(cells, lines)
    }
    for name, axis in AXES.items():
        values = [float(f"{each * axis.shown:g}") for each in axis.values]
        assert rows.pop(name) == [axis.unit.removesuffix(" late"), *values], name
    assert not rows


def test_the_block_is_written_from_a_folder_s_record(tmp_path: Path):
    points = [
        {
            "judged": 0.001,
            "jitter": 0.5,
            "limited": 0.0,
            "status": "completed",
            "lost": False,
        }
    ]
    axis = {
        "values": [1.0],
        "unit": "N",
        "noisy": False,
        "judged": "x",
        "title": "x",
        "laws": {FLAGSHIP: points},
    }
    found = {"laws": [FLAGSHIP], "axes": {"push_x": axis}}
    first, more = written(json.loads(json.dumps(found))).values()
    assert re.findall(r"\| push x, 1 to 1 N \| (\S+) \|", first) == ["1"]
    assert re.findall(r"\| push x, 1 to 1 N \| (\S+) \|", more) == [
        "1",
        "-",
        "0.5",
        "0",
    ]
    assert more.endswith("larger than that of the paper's law: none.\n")


def test_a_cell_of_the_summary_is_taken_apart_and_another_one_is_refused():
    groups = TABLES.values()
    assert [value_of("- / 2, lost at 2.5, 3; 40, 25 %", group) for group in groups] == [
        "-",
        "2",
        "at 2.5, 3",
        "40",
        "25",
    ]
    assert [value_of("20 / 20, lost from 5; 0.9", group) for group in groups] == [
        "20",
        "20",
        "from 5",
        "0.9",
        "0",
    ]
    assert [value_of("- / -, lost from 0.5", group) for group in groups] == [
        "-",
        "-",
        "from 0.5",
        "-",
        "-",
    ]
    assert [value_of("-", group) for group in groups] == ["-"] * 5
    with pytest.raises(AssertionError, match="2 of 3"):
        value_of("2 of 3", "small")
