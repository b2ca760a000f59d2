"""A comparison names its entrants."""

from __future__ import annotations

import re

import pytest


def test_a_comparison_names_its_entrants_of_which_a_list_of_laws_has_not_all() -> None:
    from skyarm.cli.compare_command import _entrants
    from skyarm.studies.compare.entrants import ENTRANTS

    with pytest.raises(ValueError, match=re.escape(f"must be one of {', '.join(ENTRANTS)}")):
        _entrants("xyzzy")
