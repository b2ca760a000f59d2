"""Progress without a terminal: lines on standard error, not too many."""

from __future__ import annotations

import io
import sys
import time

from skyarm.cli import output
from skyarm.cli.output import PLAIN, Terminal


def on(monkeypatch, file):
    """The console of the commands as a terminal."""
    monkeypatch.setattr(
        output, "console", Terminal(file=file, force_terminal=True, **PLAIN)
    )


def lines_of(monkeypatch, pause, seconds):
    """What is written when ``advance`` is called at these instants."""
    clock, errors = [0.0], io.StringIO()
    monkeypatch.setattr(output.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(sys, "stderr", errors)
    with output.bar("flying", pause) as advance:
        for done, second in enumerate(seconds):
            clock[0] = second
            advance(done + 1, len(seconds), f"case {done}\x1b[2J")
    return errors.getvalue().splitlines()


def test_without_a_pause_every_step_is_a_line(monkeypatch):
    found = lines_of(monkeypatch, 0.0, [0.0, 0.1])
    assert found == [
        "skyarm: flying: 1 of 2 case 0\\x1b[2J",
        "skyarm: flying: 2 of 2 case 1\\x1b[2J",
    ]


def test_lines_are_ten_seconds_apart_and_the_first_waits_as_long(monkeypatch):
    found = lines_of(monkeypatch, output.PAUSE, [1.0, 9.9, 10.1, 15.0, 20.0, 20.2])
    assert [line.split()[2] for line in found] == ["3", "6"]


def test_nothing_stops_when_nobody_reads_any_more(monkeypatch):
    class Gone(io.StringIO):
        def write(self, _text):
            raise BrokenPipeError

    monkeypatch.setattr(sys, "stderr", Gone())
    with output.bar("flying", 0.0) as advance:
        advance(1, 2, "")


class Screen(io.StringIO):
    """A terminal."""

    def isatty(self):
        return True


def test_a_bar_moves_on_standard_error_where_only_that_is_a_terminal(monkeypatch):
    screen, out = Screen(), io.StringIO()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    with output.bar("flying", 1e9) as advance:  # no line comes in that time
        advance(1, 2, "case")
    assert "flying" in screen.getvalue()
    assert not out.getvalue()


def test_what_cannot_be_counted_is_a_line_after_a_while_and_none_before(monkeypatch):
    for pause, wanted in ((0.01, ["skyarm: counting ..."]), (30.0, [])):
        errors = io.StringIO()
        monkeypatch.setattr(sys, "stderr", errors)
        with output.bar("counting", pause):
            time.sleep(0.1)
        assert errors.getvalue().splitlines() == wanted


def test_steps_of_what_cannot_be_counted_are_said_now_and_then(monkeypatch):
    errors = io.StringIO()
    monkeypatch.setattr(sys, "stderr", errors)
    with output.bar("measuring", 0.0) as advance:
        advance(last="speed")
    assert errors.getvalue().splitlines()[-1] == "skyarm: measuring: speed"
    screen = Screen()
    monkeypatch.setenv("TERM", "xterm")
    on(monkeypatch, screen)
    with output.bar("measuring") as advance:
        advance(last="[s]")
    assert "measuring" in screen.getvalue()


def test_nothing_is_shown_where_nothing_was_wanted(monkeypatch):
    errors, screen = io.StringIO(), Screen()
    monkeypatch.setattr(sys, "stderr", errors)
    token = output._asked.set(output._Asked(quiet=True))
    on(monkeypatch, screen)
    with output.bar("flying", 0.0) as advance:
        advance(1, 2, "")
    output._asked.reset(token)
    assert (errors.getvalue(), screen.getvalue()) == ("", "")


def test_a_terminal_gets_a_bar_and_no_lines(monkeypatch):
    errors, out = io.StringIO(), io.StringIO()
    monkeypatch.setattr(sys, "stderr", errors)
    on(monkeypatch, out)
    with output.bar("flying", 0.0) as advance:
        advance(1, 2, "case")
    assert not errors.getvalue()
    assert "flying" in out.getvalue()
