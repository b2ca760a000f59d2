"""Drops of drawn bodies on drawn floors never gain energy."""

from __future__ import annotations

import pytest
from drawn_drops import COUNT, gained

QUICK = (12, 15)


@pytest.mark.parametrize(
    "index",
    [
        each if each in QUICK else pytest.param(each, marks=pytest.mark.thorough)
        for each in range(COUNT)
    ],
)
def test_a_drop_never_gains_energy(index: int) -> None:
    assert gained(index) < 1e-4
