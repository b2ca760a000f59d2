"""Names that commands, presets, tuned gains and the scenario's own controller have: a
plugin cannot take them.
"""

from __future__ import annotations

import pytest

from skyarm.cli.commands import COMMANDS
from skyarm.control.catalogue import OWN, PRESETS
from skyarm.records.registry import RegistryError, names, register
from skyarm.records.registry.plugins import load_plugin
from skyarm.records.registry.shipped import RESERVED, SHIPPED
from support.components import registry_kept


@pytest.fixture(autouse=True)
def _kept():
    with registry_kept():
        yield


def test_the_reserved_names_are_those_that_there_are():
    assert sorted(RESERVED["command"]["a command"]) == sorted(COMMANDS)
    assert sorted(RESERVED["law"]["a preset"]) == sorted(PRESETS)
    assert RESERVED["law"]["the controller of the scenario"] == (OWN,)


TAKEN = {
    ("command", "run"): "is a command of skyarm",
    ("command", "export"): "is a command of skyarm",
    ("law", "paper_ct"): "is a preset of skyarm",
    ("law", "indi_tuned"): "is the tuned gains of 'indi' of skyarm",
    ("law", "own"): "is the controller of the scenario of skyarm",
}


@pytest.mark.parametrize(("kind", "name"), TAKEN)
def test_a_plugin_cannot_take_a_name_that_stands_for_something_else(
    kind, name, tmp_path
):
    path = tmp_path / "mine.py"
    path.write_text(
        f"import skyarm\n\n@skyarm.register.{kind}({name!r})\ndef mine(model=None):\n  "
        "  pass\n"
    )
    before = names(kind)
    with pytest.raises(RegistryError) as caught:
        load_plugin(path)
    words = TAKEN[kind, name]
    assert (
        str(caught.value)
        == f"{kind} {name!r}: {words} and is registered by {path}; rename it"
    )
    assert names(kind) == before


def test_what_is_like_such_a_name_is_free():
    for kind, name in (
        ("command", "run2"),
        ("law", "mine_tuned"),
        ("law", "owned"),
        ("force", "own"),
        ("air", "run"),
    ):
        getattr(register, kind)(name)(lambda: None)
        assert name in names(kind)
    assert "indi" in SHIPPED["law"]
