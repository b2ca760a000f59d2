"""Names of earlier versions: each leads to what there is now, where it is met."""

from __future__ import annotations

import dataclasses
import importlib
import re
from importlib.util import find_spec
from pathlib import Path

import pytest

import skyarm
from skyarm.cli.commands import COMMANDS
from skyarm.control.catalogue import LAWS, PRESETS, ControllerError, make_controller
from skyarm.records.files import did_you_mean, must_be_one_of
from skyarm.records.files.messages import present_names
from skyarm.records.registry.shipped import SHIPPED

MODULES = present_names("module")
ROOT = Path(skyarm.__file__).parent
DOCS = Path(__file__).resolve().parents[3] / "docs"
WORDS = "".join(path.read_text("utf-8") for path in (*DOCS.glob("*.md"), *ROOT.glob("control/blocks/*.py")))


def test_a_former_module_or_name_is_refused_with_the_present_one() -> None:
    for former, now in MODULES.items():
        above, _, name = former.rpartition(".")
        line = f"^{re.escape(former)}: is now {re.escape(now)}$"
        with pytest.raises(ModuleNotFoundError, match=line):
            importlib.import_module(f"{former}.whatever")
        if former in ("skyarm.compare", "skyarm.film", "skyarm.tune"):
            assert callable(getattr(skyarm, name))  # a function of now
            continue
        with pytest.raises(ModuleNotFoundError, match=line):
            exec(f"from {above} import {name}")
        if above == "skyarm":
            assert not hasattr(skyarm, name)
            with pytest.raises(AttributeError, match=line):
                getattr(skyarm, name)


def test_the_present_module_or_name_exists() -> None:
    for present in [re.split("[ ,]", now)[0] for now in MODULES.values() if now.startswith("skyarm")]:
        above, _, name = present.rpartition(".")
        assert find_spec(present) or hasattr(importlib.import_module(above), name), present


def test_other_missing_modules_and_names_are_as_python_says_them() -> None:
    with pytest.raises(ModuleNotFoundError, match=r"^No module named 'skyarm\.nothing'$"):
        importlib.import_module("skyarm.nothing")
    with pytest.raises(AttributeError, match=r"^module 'skyarm' has no attribute 'nothing'$"):
        skyarm.nothing  # noqa: B018


def test_former_commands_are_none_and_lead_to_one() -> None:
    for former, now in present_names("command").items():
        assert former not in COMMANDS
        assert set(re.findall(r"skyarm ([a-z]+)", now)) <= {*COMMANDS}


def test_former_words_lead_to_one_there_is() -> None:
    laws = {*LAWS, *PRESETS, *(name for rows in SHIPPED.values() for name in rows)}
    for former, now in present_names("word").items():
        assert former not in laws
        present = now.split("'")[1]
        assert present in laws or re.search(rf"\b{present}\b", WORDS), former
        assert did_you_mean(former, ["other", present]) == f"is now {now}; "
        assert must_be_one_of([present], former) == f"is now {now}; must be {present}"
        assert "is now" not in did_you_mean(former, ["other"])


def test_a_former_word_is_explained_where_it_is_met() -> None:
    model = skyarm.load_scenario("case1").controller.par.model
    with pytest.raises(ControllerError, match=r"= 'ct_observer': is now 'ct_ladder' with steps = 3; must"):
        make_controller("ct_observer", model)
    with pytest.raises(ControllerError, match=r"no such option; is now 'observer'; it has"):
        make_controller("ct_ladder", model, observation=1.0)
    with pytest.raises(TypeError, match=r"^Scenario: is now 'reference'; has no field trajectory$"):
        dataclasses.replace(skyarm.load_scenario("case1"), trajectory=1)


def test_a_subpackage_whose_library_is_missing_is_an_import_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def lacking(name: str) -> None:
        raise ModuleNotFoundError("No module named 'gymnasium'")

    monkeypatch.delattr(skyarm, "envs", raising=False)
    monkeypatch.setattr(skyarm, "import_module", lacking)
    with pytest.raises(ModuleNotFoundError, match="gymnasium"):
        skyarm.envs  # noqa: B018
