"""Switch times of every signal of a trajectory, and rates that hold no whole number of
each other.
"""

from __future__ import annotations

import math
from fractions import Fraction

import pytest

from skyarm.reference import Constant, Publisher, Ramp, Trajectory

PLACES = ("x", "y", "z", "yaw", "first", "second")


def ramp(place):
    """Begins and ends at times no other place has, with a height of its own."""
    k = PLACES.index(place)
    return Ramp(start=1.0 + 0.1 * k, duration=10.0 + k, height=2.0**k)


def moving(*places):
    """A trajectory of two joints that moves at these places only."""
    signals = {
        place: ramp(place) if place in places else Constant(0.0) for place in PLACES
    }
    first, second = signals.pop("first"), signals.pop("second")
    return Trajectory(**signals, joints=(first, second))


def positions(trajectory, t):
    sample = trajectory.at(t)
    return dict(
        zip(PLACES, (*sample.position, sample.yaw, *sample.joints), strict=True)
    )


@pytest.mark.parametrize("place", PLACES)
def test_the_times_of_every_signal_are_times_of_the_trajectory(place):
    assert moving(place).switch_times() == ramp(place).switch_times()
    others = tuple(other for other in PLACES if other != place)
    assert set(moving(*others).switch_times()) == {
        t for other in others for t in ramp(other).switch_times()
    }
    later = tuple(t + 5.0 for t in ramp(place).switch_times())
    assert moving(place).shifted(5.0).switch_times() == later


@pytest.mark.parametrize("place", PLACES)
def test_every_signal_keeps_its_place_when_trajectories_are_moved_and_added(place):
    """Heights are powers of two, so that a sum says what it is made of."""
    after = 50.0
    assert positions(moving(place), after) == dict.fromkeys(PLACES, 0.0) | {
        place: 2.0 ** PLACES.index(place)
    }
    assert positions(moving(place).shifted(20.0), after) == positions(
        moving(place), after
    )
    assert positions(moving(place).shifted(20.0), 20.0) == dict.fromkeys(PLACES, 0.0)
    both = moving(*PLACES) + moving(place)
    wanted = {other: 2.0**k for k, other in enumerate(PLACES)}
    assert positions(both, after) == wanted | {place: 2.0 * wanted[place]}


@pytest.mark.parametrize("periods", [1, 2, 3, 7, 1000])
def test_rates_divide_from_either_side_of_a_whole_number(periods):
    """1e-9 of the quotient is let pass, as rates such as 1000/3 Hz are given rounded;
    ten times that is not.
    """
    reference = 1000.0 / 3.0
    for wrong in (1e-8, 1e-4, 0.1, 0.3, 0.49):
        for sign in (-1.0, 1.0):
            share = 1.0 + sign * wrong / periods if wrong >= 0.1 else 1.0 + sign * wrong
            with pytest.raises(
                ValueError, match=r"^reference_rate = .*: must divide control_rate = "
            ):
                Publisher(
                    control_rate=reference * periods * share, reference_rate=reference
                )
    for within in (-5e-10, 0.0, 5e-10):
        held = Publisher(
            control_rate=reference * periods * (1.0 + within), reference_rate=reference
        )
        assert held.ratio == periods


def test_of_all_small_whole_rates_those_that_divide_are_taken():
    """Exact fractions are the oracle."""
    for control in range(1, 41):
        for reference in range(1, 41):
            whole = Fraction(control, reference).denominator == 1
            try:
                taken = (
                    Publisher(control_rate=control, reference_rate=reference).ratio
                    == control // reference
                )
            except ValueError:
                taken = False
            assert taken == whole, (control, reference)


def test_a_rate_too_small_for_a_quotient_is_refused():
    with pytest.raises(ValueError, match="must divide"):
        Publisher(control_rate=math.ulp(0.0), reference_rate=1e9)
