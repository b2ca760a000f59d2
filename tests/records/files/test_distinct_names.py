"""Names of columns, topics and files, made unique."""

import pytest

from skyarm.records.files.names import distinct
from skyarm.records.files.user_code import number_duplicates


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


def test_a_file_name_of_several_digests_is_numbered_past_the_names_that_are_there():
    pairs = [("law.py (3)", "1"), ("law.py", "2"), ("law.py", "3"), ("law.py", "2")]
    assert number_duplicates(pairs) == {
        "law.py (3)": "1",
        "law.py": "2",
        "law.py (4)": "3",
    }
