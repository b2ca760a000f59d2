"""The envelope that docs/comparing_laws.md shows is what flights give; ``make envelope`` writes it anew."""

from __future__ import annotations

import json
import re
from pathlib import Path

from envelope_of_laws import BLOCK, PAGE, PICTURE, ROOT, block
from envelope_rules import FLAGSHIP

from skyarm.studies.compare.envelope import Envelope, summary_rows
from support.studies import cell_of

TEXT = (ROOT / PAGE).read_text("utf-8")
FLOWN = ("circle", "payload")
"""Axes that the test flies; more would take a minute."""


def shown():
    """Rows of the page's table by their first cell, and its head."""
    (text,) = BLOCK.findall(TEXT)
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line[:1] == "|"]
    return rows[0], {row[0]: row for row in rows[2:]}


def test_the_page_shows_what_flights_give():
    head, rows = shown()
    envelope = Envelope(laws=("paper_ct", FLAGSHIP), axes=FLOWN)
    todo, refused = envelope.plan_cells()
    found = envelope.judge(todo, [cell_of(each) for each in todo], refused)
    for row in summary_rows(found["axes"], envelope.laws):
        written = rows[row[0]]
        told = [written[head.index(law)] for law in envelope.laws]
        assert told == row[1:], f"{row[0]}: 'make envelope' writes the table anew"


def test_every_axis_and_law_stands_in_it():
    from skyarm.studies.compare.envelope_axes import AXES

    head, rows = shown()
    assert len(rows) == len(AXES)
    assert {"paper_ct", FLAGSHIP} <= set(head)
    assert f"]({PICTURE.removeprefix('docs/')})" in TEXT
    assert "](docs/results_envelope.md)" in (ROOT / "README.md").read_text("utf-8")
    assert (ROOT / PICTURE).stat().st_size <= 5e5


def test_the_block_is_written_from_a_folder_s_record(tmp_path: Path):
    points = [{"judged": 0.001, "jitter": 0.5, "limited": 0.0, "status": "completed", "lost": False}]
    axis = {"values": [1.0], "unit": "N", "noisy": False, "judged": "x", "title": "x", "laws": {FLAGSHIP: points}}
    found = {"laws": [FLAGSHIP], "axes": {"push_x": axis}}
    text = block(json.loads(json.dumps(found)))
    assert re.match(r"\|.*\n\|.*\n\| push x, 1 to 1 N \| 1 / 1; 0\.5 \|", text)
    assert text.endswith("worse than the paper's law): none.\n")
