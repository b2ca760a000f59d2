"""A comparison names its entrants, and a command that is gone what it is now."""

from __future__ import annotations

import re

import pytest

from skyarm.cli.commands import perform


def test_a_comparison_names_its_entrants_of_which_a_list_of_laws_has_not_all() -> None:
    from skyarm.studies.compare.entrants import ENTRANTS, chosen_entrants

    with pytest.raises(ValueError, match=re.escape(f"must be one of {', '.join(ENTRANTS)}")):
        chosen_entrants(["xyzzy"], "--laws")


def test_a_command_that_is_gone_says_what_it_is_now(capsys: pytest.CaptureFixture[str], monkeypatch) -> None:
    for words, line in (
        (["list", "--json"], "skyarm: command 'list': is now 'skyarm show'; see 'skyarm --help'\n"),
        (["xyzzy"], "skyarm: No such command 'xyzzy'; see 'skyarm --help'\n"),
    ):
        monkeypatch.setattr("sys.argv", ["skyarm", *words])
        assert perform() == 2
        assert capsys.readouterr().err == line
