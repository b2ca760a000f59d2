"""Members of a group by name: a mapping in order, its views, and wrong ones in one
line.
"""

from __future__ import annotations

from typing import Any

import pytest

from skyarm.records.coerce import RecordError
from skyarm.records.members import Members


def test_members_are_a_mapping_in_their_order() -> None:
    members = Members(("right", "left"), (1, 2))
    assert list(members.items()) == [("right", 1), ("left", 2)]
    assert len(members) == 2
    assert members["left"] == 2
    assert "middle" not in members
    with pytest.raises(KeyError):
        members["middle"]
    only = members.only("left")
    assert dict(only) == {"left": 2}
    assert only.others == ("right",)
    assert members.only("right").others == ("left",)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ((True,), "members.names = True: must be a tuple of names"),
        (("left", (1,)), "members.names = 'left': must be a tuple of names"),
        (((1,), (1,)), "members.names = (1,): must be a tuple of names"),
        (
            (("left",), True),
            "members.records = True: must be a tuple of 1, one for each name",
        ),
        (
            (("left",), (1, 2)),
            "members.records = (1, 2): must be a tuple of 1, one for each name",
        ),
        ((("left",), (1,), None), "members.others = None: must be a tuple of names"),
    ],
)
def test_wrong_members_are_refused_in_one_line(
    given: tuple[Any, ...], words: str
) -> None:
    with pytest.raises(RecordError) as error:
        Members(*given)
    assert str(error.value) == words
