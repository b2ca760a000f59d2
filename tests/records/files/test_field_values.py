"""Values of a table at the ends of what is allowed, and how a message shows a long
one.
"""

from __future__ import annotations

import math

import pytest

from skyarm.records.files import Fields, number, shown
from skyarm.records.files.messages import LONGEST


@pytest.mark.parametrize("length", [LONGEST - 1, LONGEST, LONGEST + 1, 5 * LONGEST])
def test_a_value_is_shown_whole_up_to_a_hundred_characters_and_cut_to_just_as_many(
    length,
):
    value = "a" * (length - 2)  # its quotes make two more
    text = repr(value)
    assert shown(value) == (text if length <= LONGEST else text[:97] + "...")
    assert len(shown(value)) == min(length, LONGEST)


def test_the_lowest_number_is_taken_unless_it_must_be_above():
    assert number(2, "a", low=2.0) == 2.0
    assert number(math.nextafter(2.0, 3.0), "a", low=2.0, strict=True) > 2.0
    for value, strict, words in (
        (1.999, False, "at least 2"),
        (2, True, "above 2"),
        (-5.0, True, "above 2"),
    ):
        with pytest.raises(ValueError, match=rf"^a = {value}: must be {words}$"):
            number(value, "a", low=2.0, strict=strict)


def test_a_number_has_no_lowest_value_and_is_finite_unless_told():
    assert (number(-1e308, "a"), number(0, "a")) == (-1e308, 0.0)
    for value in (math.inf, -math.inf, math.nan, 10**400):
        with pytest.raises(ValueError, match=r"must be a finite number$"):
            number(value, "a")
    assert (
        number(-math.inf, "a", infinite=True),
        number(math.inf, "a", infinite=True),
    ) == (-math.inf, math.inf)
    with pytest.raises(ValueError, match=r"^a = nan: must be a number$"):
        number(math.nan, "a", infinite=True)


def test_fields_hand_their_bounds_on():
    fields = Fields({"a": -3.0, "list": [-1e300, 0, 2], "short": []}, "table")
    assert fields.number("a") == -3.0
    assert fields.numbers("list") == (-1e300, 0.0, 2.0)
    assert fields.numbers("short") == ()
    assert fields.numbers("absent", [1.0]) == (1.0,)
    assert fields.numbers("list", low=-1e300) == (-1e300, 0.0, 2.0)
    with pytest.raises(
        ValueError, match=r"^table\.list\[0\] = -1e\+300: must be at least 0$"
    ):
        fields.numbers("list", low=0.0)
    with pytest.raises(ValueError, match=r"^table\.a = -3.0: must be above -3$"):
        fields.number("a", low=-3.0, strict=True)
    with pytest.raises(
        ValueError, match=r"^table\.absent: is missing; there are a, list, short$"
    ):
        fields.numbers("absent")
