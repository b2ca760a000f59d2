"""Zeros that are structure beside numbers that are data: one direction without a
gust.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from skyarm.algebra import Vec3
from skyarm.reference import Constant, Ramp, Sine, Windowed
from skyarm.world import Gust
from skyarm.world.dryden import HIGHEST, LOWEST
from skyarm.world.wind import wind_from

VELOCITY = (2.0, -3.0, 6.0)
"""m/s; its length is 7."""

RAMP, SINE = (
    Ramp(start=0.0, duration=4.0, height=1.0),
    Sine(amplitude=1.0, frequency_hz=0.1),
)


@pytest.mark.parametrize(
    "peak", list(itertools.product((0, 2.5, 1, 0.0), repeat=3)), ids=str
)
def test_a_gust_blows_in_every_direction_that_has_a_peak(peak):
    gust = Gust(peak=Vec3(*peak), start=1.0, duration=2.0)
    for t, share in ((0.5, 0.0), (1.0, 1.0), (2.9, 1.0), (3.0, 0.0)):
        assert [float(c) for c in gust.at(t)] == [share * c for c in peak]
    assert [type(c) is int for c in gust.at(2.0)] == [
        type(c) is int and c == 0 for c in peak
    ]


def test_a_window_keeps_what_its_signal_has_of_structure():
    """A constant's derivatives are structure, a sine's none, and a whole number other
    than zero is a value.
    """
    for signal in (Constant(3), Constant(0), Constant(0.0), RAMP, SINE):
        bare, inside = (
            signal.derivatives(2.0),
            Windowed(signal, 1.0, 3.0).derivatives(2.0),
        )
        assert [float(c) for c in inside] == [float(c) for c in bare]
        assert [type(c) is int for c in inside] == [
            type(c) is int and c == 0 for c in bare
        ]
        assert [float(c) for c in Windowed(signal, 1.0, 3.0).derivatives(3.0)] == [
            0.0
        ] * 5


@pytest.mark.parametrize("altitude", [LOWEST, HIGHEST])
def test_both_ends_of_the_low_altitude_model_are_part_of_it(altitude):
    """MIL-F-8785C: 10 to 1000 ft, which are 3.048 and 304.8 m; a neighbouring number
    outside is refused by name.
    """
    assert altitude in (3.048, 304.8)

    def blown(height):
        return wind_from(
            {
                "mode": "moving_air",
                "turbulence": {"altitude": height, "wind_20ft": 5.0},
            },
            "x",
        )

    # w's scale length is the altitude itself
    assert blown(altitude).turbulence.scale_length.z == pytest.approx(
        altitude, rel=1e-15
    )
    outside = np.nextafter(altitude, 0.0 if altitude == LOWEST else 1e9)
    words = "at least 3.048" if altitude == LOWEST else r"at most 304.8 m \(1000 ft\)"
    with pytest.raises(
        ValueError, match=rf"^x.turbulence.altitude = .*: must be {words}"
    ):
        blown(float(outside))
