"""Names of results, which become files on any system."""

import pytest

from skyarm.records.files.names import is_result_name


@pytest.mark.parametrize(
    "name", ["case3", "a b", "Flug über Köln", "x.y", "a-", "comet", "a" * 100]
)
def test_a_name_of_any_system_may_name_a_result(name):
    assert is_result_name(name)


@pytest.mark.parametrize(
    "name",
    [
        "",
        ".a",
        "-a",
        " a",
        "a.",
        "a ",
        "a/b",
        "a\\b",
        "a:b",
        "a\nb",
        "con",
        "NUL.toml",
        "aux .x",
        "a" * 101,
        3,
        None,
    ],
)
def test_a_name_that_some_system_takes_for_something_else_is_no_result(name):
    assert not is_result_name(name)


def test_a_name_is_measured_in_bytes_too():
    assert is_result_name("\u4e2d" * 60)
    assert not is_result_name("\u4e2d" * 100)
