"""Numbers at their limit: what must be above zero is refused at zero, what must be at
least zero is taken.
"""

from __future__ import annotations

import pytest

from skyarm.world import Fault, wind_from

AIR = {"mode": "moving_air", "velocity": [3.0, 0.0, 0.0]}
CALM = {"altitude": 10.0, "wind_20ft": 5.0}
GUST = {"velocity": [1.0, 0.0, 0.0], "start": 1.0, "duration": 2.0}


def air(*, gust=None, turbulence=None):
    table = dict(AIR)
    if gust is not None:
        table["gust"] = GUST | gust
    if turbulence is not None:
        table["turbulence"] = CALM | turbulence
    return wind_from(table, "x")


@pytest.mark.parametrize("shape", ["step", "one_minus_cosine"])
def test_a_gust_of_a_file_lasts_longer_than_nothing(shape):
    for duration in (0.0, -0.0, 0, -1.0):
        with pytest.raises(ValueError, match=r"^x.gust.duration = .*: must be above 0"):
            air(gust={"shape": shape, "duration": duration})
    assert air(gust={"shape": shape, "duration": 1e-300}).gust.duration == 1e-300
    assert air(gust={"start": -5.0}).gust.start == -5.0


def test_turbulence_may_be_nil_but_not_its_airspeed():
    assert air(turbulence={"wind_20ft": 0.0}).turbulence is not None
    with pytest.raises(
        ValueError, match=r"^x.turbulence.wind_20ft = -1.0: must be at least 0"
    ):
        air(turbulence={"wind_20ft": -1.0})
    for least in (0.0, -1.0):
        with pytest.raises(
            ValueError, match=r"^x.turbulence.minimum_airspeed = .*: must be above 0"
        ):
            air(turbulence={"minimum_airspeed": least})
    assert air(turbulence={"minimum_airspeed": 1e-3}).turbulence.airspeed == 3.0


@pytest.mark.parametrize(("rotor", "joint"), [("", ""), ("front", "joint1")])
def test_a_fault_is_of_one_actuator(rotor, joint):
    with pytest.raises(
        ValueError, match=r"^rotor = .*, joint = .*: must name one of the two$"
    ):
        Fault(rotor=rotor, joint=joint, effectiveness=0.5, start=0.0)


def test_a_fault_may_take_everything_or_nothing_from_the_start():
    for left in (0.0, 1.0):
        assert (
            Fault(joint="joint1", effectiveness=left, start=0.0).effectiveness == left
        )
    for wrong in (
        {"effectiveness": -1e-9},
        {"effectiveness": 1.0 + 1e-9},
        {"start": -1e-9},
    ):
        with pytest.raises(ValueError, match=r"must be at (least 0|most 1)"):
            Fault(**({"rotor": "front", "effectiveness": 0.5, "start": 0.0} | wrong))
