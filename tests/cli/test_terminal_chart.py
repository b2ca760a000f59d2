"""The chart with which a flight ends on a terminal, and its picture."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from commanded import refused, skyarm
from skyarm.cli.terminal_chart import BLOCKS, HEIGHT, WIDTH, chart

TIME = np.linspace(0.0, 6.0, 601)


def drawn(lines: list[str]) -> list[str]:
    """What stands right of the axis, as wide as the chart."""
    return [line.split("|", 1)[1].ljust(WIDTH) for line in lines[1:-1]]


@pytest.mark.parametrize("blocks", [True, False])
def test_a_column_is_as_high_as_the_largest_value_in_it(blocks: bool) -> None:
    values = np.zeros(TIME.size)
    values[305] = 8.0  # in column 30 of 60
    values[100:110] = 4.0  # in column 10
    lines = drawn(chart(TIME, values, "x", blocks=blocks))
    full = BLOCKS[-1] if blocks else "|"
    columns = ["".join(line[k] for line in lines) for k in range(WIDTH)]
    assert len(lines) == HEIGHT
    assert columns[30] == full * HEIGHT
    assert columns[10] == " " * (HEIGHT // 2) + full * (HEIGHT // 2)
    assert {each for k, each in enumerate(columns) if k not in (10, 30)} == {" " * HEIGHT}


def test_part_of_a_row_is_part_of_a_block() -> None:
    values = np.full(TIME.size, 1.0)
    values[0] = HEIGHT * 8.0
    lines = drawn(chart(TIME, values, "x", blocks=True))
    assert lines[-1] == BLOCKS[-1] + BLOCKS[1] * (WIDTH - 1)


@pytest.mark.parametrize("count", [1, 2, 7, 40])
def test_a_flight_of_few_instants_has_no_empty_columns(count: int) -> None:
    """Each instant stays until the next, as a control period does."""
    time = np.arange(count) * 0.005
    rows = chart(time, np.linspace(0.5, 1.0, count), "x", width=60, blocks=True)[1:-1]
    drawn = [row.partition("|")[2] for row in rows]
    assert drawn[-1] == "\N{FULL BLOCK}" * 60
    counts = [sum(row[k : k + 1] not in ("", " ") for row in drawn) for k in range(60)]
    assert counts == sorted(counts)


def test_axes_say_the_largest_value_zero_and_the_ends() -> None:
    lines = chart(TIME, np.full(TIME.size, 0.8494), "tip error, mm", blocks=True)
    assert lines[0] == "tip error, mm"
    assert lines[1].startswith("0.849 |")
    assert lines[-2].startswith("    0 |")
    assert lines[-1].split() == ["0", "6", "s"]
    assert max(map(len, lines)) < 80


def test_what_is_not_finite_is_left_out_and_nothing_is_no_chart() -> None:
    assert chart(TIME, np.full(TIME.size, np.nan), "x") == []
    assert chart(np.zeros(0), np.zeros(0), "x") == []
    values = np.full(TIME.size, 2.0)
    values[-1] = np.inf
    assert chart(TIME, values, "x")[1].startswith("2 |")
    assert drawn(chart(TIME, np.zeros(TIME.size), "x")) == [" " * WIDTH] * HEIGHT


def test_a_terminal_without_blocks_gets_ascii(monkeypatch: pytest.MonkeyPatch) -> None:
    import io

    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(io.BytesIO(), encoding="ascii"))
    assert all(line.isascii() for line in chart(TIME, TIME, "x"))
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(io.BytesIO(), encoding="utf-8"))
    assert BLOCKS[-1] in chart(TIME, TIME, "x")[-2]


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
def test_a_flight_ends_with_a_chart_on_a_terminal_and_without_one_in_a_pipe(tmp_path: Path) -> None:
    words = ["run", "case3", "--duration", "1", "--out", str(tmp_path)]
    ours, theirs = os.openpty()
    with subprocess.Popen([sys.executable, "-m", "skyarm", *words], stdout=theirs, stderr=theirs) as flying:
        os.close(theirs)
        text = b""
        with contextlib.suppress(OSError):  # the last reading, when nobody holds the other end
            while part := os.read(ours, 65536):
                text += part
    os.close(ours)
    assert flying.returncode == 0
    shown = text.decode()
    assert "tip error, mm" in shown
    assert shown.count(" |") >= HEIGHT
    assert "tip error, mm" not in skyarm(*words).out


def test_a_picture_is_drawn_where_it_is_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    ended = skyarm("run", "case3", "--duration", "0.2", "--plot", "a.png")
    assert ended.code == 0, ended.err
    assert "picture: a.png" in ended.out
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    refused(skyarm("run", "case3", "--plot", "d.gif"), "--plot = 'd.gif'", "must be one of png, svg, pdf")
    refused(skyarm("run", "case3", "--plot", "a.png/b.png"), "a.png", "must be writable")
    assert not (tmp_path / "d.gif").exists()
