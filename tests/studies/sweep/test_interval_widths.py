"""An interval of a sweep may lie anywhere among floating-point numbers, if its own
width is one of them.
"""

from __future__ import annotations

import pytest

from skyarm.studies.sweep.distributions import distribution_from


@pytest.mark.parametrize(
    "ends",
    [[1.0e308, 1.5e308], [-1.5e308, -1.0e308], [-8.0e307, 8.0e307], [0.0, 5e-324]],
)
@pytest.mark.parametrize("kind", ["uniform"])
def test_far_ends_are_taken(kind, ends):
    distribution_from({kind: ends}, "vary.a")


@pytest.mark.parametrize("ends", [[-1.5e308, 1.5e308], [1.0, 1.0], [2.0, 1.0]])
@pytest.mark.parametrize("kind", ["uniform", "grid"])
def test_ends_without_a_width_that_is_a_number_are_refused(kind, ends):
    with pytest.raises(
        ValueError, match=r"must be two numbers, the first below the second$"
    ):
        distribution_from({kind: [*ends, 3] if kind == "grid" else ends}, "vary.a")
