"""Names of columns and topics, made unique."""

import pytest

from skyarm.records.files.names import distinct


@pytest.mark.parametrize(
    ("names", "unique"),
    [
        (["a", "b"], ["a", "b"]),
        (["a", "a", "b", "a", "a"], ["a", "a_2", "b", "a_3", "a_4"]),
        (["a", "a", "a_2", "a"], ["a", "a_3", "a_2", "a_4"]),
    ],
)
def test_repeated_names_are_counted_past_those_that_are_there(names, unique):
    assert distinct(names) == unique
