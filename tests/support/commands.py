"""The command line in this process: what it ends with and what it prints, without the
start of an interpreter.
"""

from __future__ import annotations

import contextlib
import io
import sys
from dataclasses import dataclass

import pytest

from skyarm.cli.main import main
from skyarm.cli.output import console


@dataclass(frozen=True)
class Outcome:
    """Exit code, standard output and standard error of one command."""

    code: int
    out: str
    err: str


def skyarm(*arguments: str, columns: int = 80) -> Outcome:
    """The command as its entry point runs it, in this process; on a terminal of so many
    columns.
    """
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["skyarm", *arguments])
        patch.setenv("COLUMNS", str(columns))
        patch.setattr(console, "_width", columns)
        with (
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
            pytest.raises(SystemExit) as stop,
        ):
            main()
    code = stop.value.code
    return Outcome(code if isinstance(code, int) else 0, out.getvalue(), err.getvalue())


def refused(outcome: Outcome, *words: str) -> None:
    """One line on standard error that holds the words, and exit code 2."""
    assert outcome.code == 2, outcome
    assert outcome.err.count("\n") == 1, outcome.err
    assert outcome.err.startswith("skyarm: ")
    assert "Traceback" not in outcome.err
    for word in words:
        assert word in outcome.err, (word, outcome.err)
