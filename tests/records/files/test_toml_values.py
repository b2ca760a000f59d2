"""A value that is written as TOML reads back as what it was."""

from __future__ import annotations

import tomllib

import pytest

from skyarm.records.files.toml import toml_key, toml_value


@pytest.mark.parametrize(
    "value",
    [
        'a "quoted" \\ text\nof two lines',
        "",
        True,
        False,
        3,
        -0.1,
        1e-300,
        [1.5, "x", [True]],
        {"a": {"b c": [1, 2]}, "d": {}},
    ],
)
def test_a_value_reads_back_as_it_was(value: object) -> None:
    found = tomllib.loads(f"x = {toml_value(value)}")["x"]
    assert found == value
    assert type(found) is type(value)


def test_a_name_that_is_no_bare_word_is_quoted() -> None:
    assert [
        toml_key(name) for name in ("plain_word-1", "plant.gravity", "two words")
    ] == [
        "plain_word-1",
        '"plant.gravity"',
        '"two words"',
    ]
