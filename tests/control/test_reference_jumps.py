"""Where the continued reference takes a sample for a jump: at the documented share, to
half a percent.
"""

from __future__ import annotations

import pytest

from skyarm.control.blocks.extrapolation import extrapolate
from skyarm.control.laws.centroidal.law import Channel

PERIOD, DT = 0.02, 0.005


def count_after(first, second, miss):
    """Samples in a row that agree, after two whose rate misses the mean of their
    accelerations by ``miss``, per s.
    """
    channels, age = (Channel(),), 0.0
    _, channels, age = extrapolate(channels, age, [(0.0, 0.0, first)], 0.0, DT, PERIOD)
    rate = PERIOD * (0.5 * (first + second) + miss)
    _, channels, age = extrapolate(
        channels, age, [(0.1, rate, second)], 1.0, DT, PERIOD
    )
    assert age == 0.0
    return channels[0].count


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("first", "second"), [(5.0, 5.0), (0.0, 8.0), (8.0, 0.0), (-6.0, 3.0), (-4.0, -4.0)]
)
def test_a_rate_jumps_if_it_misses_a_tenth_of_the_change_and_a_fiftieth_of_the_size(
    first, second, sign
):
    allowed = 0.1 * abs(second - first) + 0.02 * (abs(first) + abs(second))
    assert count_after(first, second, sign * 0.995 * allowed) == 1.0
    assert count_after(first, second, sign * 1.005 * allowed) == 0.0
