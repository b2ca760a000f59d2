"""Names that the package lacks, and subpackages whose library is missing, are told as
Python tells them.
"""

from __future__ import annotations

import importlib

import pytest

import skyarm


def test_other_missing_modules_and_names_are_as_python_says_them() -> None:
    with pytest.raises(
        ModuleNotFoundError, match=r"^No module named 'skyarm\.nothing'$"
    ):
        importlib.import_module("skyarm.nothing")
    with pytest.raises(
        AttributeError, match=r"^module 'skyarm' has no attribute 'nothing'$"
    ):
        skyarm.nothing  # noqa: B018


def test_a_subpackage_whose_library_is_missing_is_an_import_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def lacking(name: str) -> None:
        raise ModuleNotFoundError("No module named 'gymnasium'")

    monkeypatch.delattr(skyarm, "envs", raising=False)
    monkeypatch.setattr(skyarm, "import_module", lacking)
    with pytest.raises(ModuleNotFoundError, match="gymnasium"):
        skyarm.envs  # noqa: B018
