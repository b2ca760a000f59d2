"""Which arrays of objects are numbers: those of real numbers only, never text that
reads like one.
"""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest

from skyarm.dynamics.array_front import components, finite_numbers, one_number


def test_objects_that_are_real_numbers_are_taken():
    found = finite_numbers(
        "x", np.array([Fraction(1, 2), 3, 0.25, np.float32(2.0)], dtype=object)
    )
    assert (found.dtype, found.tolist()) == (np.dtype(float), [0.5, 3.0, 0.25, 2.0])
    assert components("x", [2**70, 1], 2) == (float(2**70), 1.0)


@pytest.mark.parametrize(
    "entry",
    [
        "1.5",
        b"2",
        Decimal("1.5"),
        None,
        1j,
        np.array([1.0]),
        np.datetime64("2020-01-01"),
    ],
)
@pytest.mark.parametrize("company", [[], [1.0, Fraction(1, 2)]])
def test_other_objects_are_refused_by_name_alone_and_among_numbers(entry, company):
    values = np.empty(1 + len(company), dtype=object)
    values[:] = [entry, *company] if company else None
    values[0] = entry
    with pytest.raises(ValueError, match=r"^x = .*: must be finite numbers$"):
        finite_numbers("x", values)


@pytest.mark.parametrize(
    "value", ["1", True, [1.0], np.array("2", dtype=object), float("inf")]
)
def test_one_number_is_no_text_truth_value_or_list(value):
    with pytest.raises(ValueError, match=r"^gravity = .*: must be one finite number$"):
        one_number("gravity", value)
