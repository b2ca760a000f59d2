"""Readers of a law's options one by one: what each takes as it is, and what it refuses by name and value."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from skyarm.control.controller import ControllerError
from skyarm.control.options import flag, positive, three, whole


@pytest.mark.parametrize("value", [True, False])
def test_a_flag_is_true_or_false(value):
    assert flag("x", value) is value


@pytest.mark.parametrize("value", [0, 1, 1.0, "true", None, [], [True]])
def test_what_is_like_a_flag_is_none(value):
    with pytest.raises(ControllerError, match=rf"^controller\.x = {re.escape(repr(value))}: must be true or false$"):
        flag("x", value)


@pytest.mark.parametrize("value", [0, 1, 100])
def test_a_whole_number_lies_from_0_to_100(value):
    assert whole("x", value) is value


@pytest.mark.parametrize("value", [-1, 101, True, False, 3.0, "3", None, math.nan])
def test_what_is_no_whole_number_from_0_to_100_is_refused(value):
    with pytest.raises(ControllerError, match=rf"^controller\.x = {value!r}: must be a whole number from 0 to 100$"):
        whole("x", value)


def test_a_number_is_above_zero_or_at_least_zero_if_that_is_allowed():
    tiny = math.nextafter(0.0, 1.0)
    assert positive("x", tiny) == tiny
    assert positive("x", 3) == 3.0
    assert positive("x", 0.0, zero=True) == 0.0
    with pytest.raises(ControllerError, match=r"^controller\.x = 0\.0: must be above 0$"):
        positive("x", 0.0)
    with pytest.raises(ControllerError, match=r"^controller\.x = -5e-324: must be at least 0$"):
        positive("x", -tiny, zero=True)


@pytest.mark.parametrize("value", [True, "1", None, math.nan, math.inf, [1.0]])
def test_what_is_no_number_is_refused(value):
    for zero in (False, True):
        with pytest.raises(ControllerError, match=r"^controller\.x = .*: must be a finite number"):
            positive("x", value, zero=zero)


def test_three_numbers_are_three_and_each_is_checked():
    assert three("x", [1, 2.0, 3]) == (1.0, 2.0, 3.0)
    assert three("x", (0.0, 2.0, 0.0), zero=True) == (0.0, 2.0, 0.0)
    for i in range(3):
        values = [1.0, 2.0, 3.0]
        values[i] = 0.0
        with pytest.raises(ControllerError, match=rf"^controller\.x\[{i}\] = 0\.0: must be above 0$"):
            three("x", values)


@pytest.mark.parametrize("value", [(1.0, 2.0), (1.0, 2.0, 3.0, 4.0), 3.0, "123", {1: 1, 2: 2, 3: 3}, np.ones(3)])
def test_what_are_not_three_numbers_is_refused(value):
    with pytest.raises(ControllerError, match=r"^controller\.x = .*: must be three numbers$"):
        three("x", value)
