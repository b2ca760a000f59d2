"""A comparison names its entrants, and an unknown command is refused in one line."""

from __future__ import annotations

import re

import pytest

from skyarm.cli.commands import perform


def test_a_comparison_names_its_entrants_of_which_a_list_of_laws_has_not_all() -> None:
    from skyarm.studies.compare.entrants import ENTRANTS, chosen_entrants

    with pytest.raises(
        ValueError, match=re.escape(f"must be one of {', '.join(ENTRANTS)}")
    ):
        chosen_entrants(["xyzzy"], "--laws")


def test_an_unknown_command_is_refused_in_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch
) -> None:
    for words, line in (
        (["list", "--json"], "skyarm: No such command 'list'; see 'skyarm --help'\n"),
        (["xyzzy"], "skyarm: No such command 'xyzzy'; see 'skyarm --help'\n"),
    ):
        monkeypatch.setattr("sys.argv", ["skyarm", *words])
        assert perform() == 2
        assert capsys.readouterr().err == line
