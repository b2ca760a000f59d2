"""TOML files of very many keys: refused before they are read, and a message that
searches few of them.
"""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from skyarm.records.files import Fields, read_toml
from skyarm.records.files import toml as module
from support.commands import refused, skyarm

MANY = 200_000


@pytest.mark.parametrize(
    "head", ["", pytest.param("[plant]\n", marks=pytest.mark.thorough)]
)
def test_a_file_of_200_000_keys_is_refused_within_a_second(
    tmp_path: Path, head: str
) -> None:
    (tmp_path / "many.toml").write_text(
        head + "\n".join(f"a{i} = {i}" for i in range(MANY))
    )
    began = time.process_time()
    refused(
        skyarm("run", str(tmp_path / "many.toml")),
        "many.toml: TOML = 20000",
        "keys: must be at most 50000",
    )
    assert time.process_time() - began < 1.0


@pytest.mark.parametrize(
    "text",
    [
        "a = 1\nb = 2\nc = 3",
        "'a' = 1\n  b = 2\na.b = 3",
        "[a]\n  [b]\n[c.d] # third",
        "[[a]]\n[[a]]\n[[a]]",
        "a = {b = 1, c = 2}",
    ],
)
def test_every_way_to_write_a_key_counts(
    monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    monkeypatch.setattr(module, "MOST_KEYS", 2)
    with pytest.raises(ValueError, match="TOML = 3 keys: must be at most 2"):
        read_toml(text.encode())


@pytest.mark.parametrize("begin", ["[", "{a=", "a."])
def test_tables_are_nested_at_most_64_deep(begin: str) -> None:
    end = {"[": "]", "{a=": "}", "a.": ""}[begin]

    def nested(depth: int) -> bytes:
        inner = "b = 1" if begin == "a." else "1"
        key = "" if begin == "a." else "x = "
        return f"{key}{begin * (depth - 1)}{inner}{end * (depth - 1)}".encode()

    assert read_toml(nested(module.DEEPEST))
    with pytest.raises(ValueError, match="must be nested at most 64 deep"):
        read_toml(nested(module.DEEPEST + 1))


def test_rows_of_numbers_are_no_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_KEYS", 1)
    assert read_toml(b"a = [\n[1, 2],\n  [3, 4],\n[5, 6]\n]") == {
        "a": [[1, 2], [3, 4], [5, 6]]
    }


def test_a_missing_field_among_many_is_told_at_once() -> None:
    table = {f"a{i}": i for i in range(MANY)}
    began = time.process_time()
    with pytest.raises(ValueError, match="plant: is missing; there are a0, "):
        Fields(table, "").take("plant")
    assert time.process_time() - began < 1.0
    with pytest.raises(ValueError, match="is 'plan' a misspelling of it"):
        Fields({"plan": 1, **table}, "").take("plant")
