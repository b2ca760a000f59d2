"""Two modes of wind, gusts, drag of the airframe, payload."""

import math

import numpy as np
import pytest

from skyarm.algebra import Mat3, Sym3, Vec3
from skyarm.compile import trace
from skyarm.records.coerce import RecordError
from skyarm.records.leaves import leaves
from skyarm.scenario.numbers import with_numbers
from skyarm.vehicle import Body, Frame, Joint, Link, Vehicle
from skyarm.world import NO_WIND, ForceWind, Gust, MovingAir, Payload, WindSample
from skyarm.world.dryden import Dryden, DrydenMemory, low_altitude
from support.flights import estimated
from support.worlds import wind

CASE3 = ForceWind(force_W=Vec3(2.0, 0, 0), air_velocity_W=Vec3(2.0, 0, 0))
CASE2_GUST = ForceWind(gust=Gust(peak=Vec3(2.0, 0, 0), start=7.5, duration=3.0))


def test_force_wind_keeps_newtons_and_metres_per_second_apart():
    sample = wind(CASE3, 1.0)
    assert list(sample.force_W) == [2.0, 0, 0]
    assert list(sample.air_velocity_W) == [2.0, 0, 0]
    only_force = wind(ForceWind(force_W=Vec3(3.0, -1.0, 0)), 1.0)
    assert list(only_force.force_W) == [3.0, -1.0, 0]
    assert list(only_force.air_velocity_W) == [0, 0, 0]
    only_air = wind(ForceWind(air_velocity_W=Vec3(0, 4.0, 0)), 1.0)
    assert list(only_air.force_W) == [0, 0, 0]
    assert list(only_air.air_velocity_W) == [0, 4.0, 0]


def test_a_gust_of_force_lasts_a_half_open_window_and_never_moves_the_air():
    def force(t):
        return wind(CASE2_GUST, t).force_W.x

    assert [force(t) for t in (0.0, 7.499, 7.5, 9.0, 10.499, 10.5, 20.0)] == [
        0.0,
        0.0,
        2.0,
        2.0,
        2.0,
        0.0,
        0.0,
    ]
    assert list(wind(CASE2_GUST, 9.0).air_velocity_W) == [0, 0, 0]


def test_mean_force_gust_and_offset_act_together():
    par = ForceWind(
        force_W=Vec3(1.0, 0, 0),
        point_B=Vec3(0.1, 0, -0.2),
        gust=Gust(peak=Vec3(0.5, 2.0, 0), start=1.0, duration=1.0),
    )
    sample = wind(par, 1.5)
    assert list(sample.force_W) == [1.5, 2.0, 0]
    assert list(sample.point_B) == [0.1, 0, -0.2]


def test_airspeed_adds_mean_gust_and_turbulence_and_pushes_nothing():
    unit = Dryden(
        intensity=Vec3(1.0, 1.0, 1.0), scale_length=Vec3(9.0, 9.0, 9.0), airspeed=3.0
    )
    gust = Gust(peak=Vec3(0, 3.0, 0), start=2.0, duration=1.0)
    par = MovingAir(velocity_W=Vec3(5.0, 0, 0), gust=gust, turbulence=unit)
    blowing = DrydenMemory(0.1, -0.2, 0.3, 0.0, 0.0)  # along x, left of it, up
    sample = wind(par, 2.5, blowing)
    assert list(sample.air_velocity_W) == [5.1, 2.8, 0.3]
    assert list(sample.force_W) == [0, 0, 0]
    assert list(wind(par, 3.0, blowing).air_velocity_W) == [5.1, -0.2, 0.3]


def test_force_wind_has_no_turbulence():
    assert CASE3.uniforms == 0
    assert CASE3.start(0.005, ()) == CASE3.advance((), 0.0, 0.005, None, ()) == ()
    assert wind(CASE3, 1.0, DrydenMemory(1.0, 1.0, 1.0, 1.0, 1.0)) == wind(CASE3, 1.0)


def test_no_wind_folds_away():
    for t in (0.0, 1.0):
        assert wind(NO_WIND, t) == WindSample()
    # structural zeros are no scalars of a program
    assert leaves(wind(NO_WIND, 0.0)) == []
    program = trace(lambda t: wind(CASE2_GUST, t).force_W, 0.0)
    assert len(program.outputs) == 1  # only the gust's own axis is computed


def test_one_minus_cosine_rises_smoothly_to_its_peak_and_back():
    gust = Gust(
        peak=Vec3(4.0, 0, -2.0), start=1.0, duration=2.0, shape="one_minus_cosine"
    )
    values = {t: gust.at(t).x for t in (0.5, 1.0, 1.5, 2.0, 2.5, 3.0)}
    # by hand: sin^2 of a quarter, a half, three quarters of pi; 1e-15: rounding of pi
    assert values == pytest.approx(
        {0.5: 0.0, 1.0: 0.0, 1.5: 2.0, 2.0: 4.0, 2.5: 2.0, 3.0: 0.0}, abs=1e-14
    )
    assert gust.at(2.0).z == pytest.approx(-2.0)
    assert gust.at(1.25).x == pytest.approx(4.0 * math.sin(math.pi / 8.0) ** 2)


def test_time_may_be_an_array_or_traced():
    par = MovingAir(
        gust=Gust(
            peak=Vec3(4.0, 0, 0), start=1.0, duration=2.0, shape="one_minus_cosine"
        )
    )
    times = np.linspace(0.0, 4.0, 41)
    table = wind(par, times).air_velocity_W.x
    program = trace(lambda t: wind(par, t).air_velocity_W, 0.0)
    for t, value in zip(times.tolist(), table, strict=True):
        single = wind(par, t).air_velocity_W.x
        assert value == pytest.approx(single, abs=1e-15)
        assert program.flat([t])[0] == single


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"shape": "sawtooth"}, "must be one of step, one_minus_cosine"),
        ({"duration": -1.0}, "must be at least 0"),
        ({"duration": math.nan}, "must be a finite number"),
        ({"duration": 0.0, "shape": "one_minus_cosine"}, "must be above 0"),
    ],
)
def test_an_impossible_gust_is_refused(fields, message):
    with pytest.raises(ValueError, match=message):
        Gust(peak=Vec3(1.0, 0, 0), **fields)


def test_a_smooth_gust_of_force_is_refused():
    with pytest.raises(ValueError, match="'step' as in RotorS"):
        ForceWind(
            gust=Gust(peak=Vec3(1.0, 0, 0), duration=1.0, shape="one_minus_cosine")
        )


def tip_vehicle():
    base = Body(mass=1.0, inertia=Sym3.isotropic(0.01))
    joint = Joint(name="shoulder")
    link = Link(
        name="upper", parent=-1, joint=joint, body=Body(mass=0.2, com=Vec3(0, 0, -0.1))
    )
    tip = Frame(name="tip", link=0, position=Vec3(0, 0, -0.3), rotation=Mat3.identity())
    top = Frame(name="top", link=-1, position=Vec3(0, 0, 0.1))
    return Vehicle(
        name="v", base=base, links=(link,), frames=(tip, top), end_effector="tip"
    )


def test_a_payload_hangs_at_the_end_effector_unless_told_otherwise():
    loaded = Payload(mass=0.1).held_by(tip_vehicle())
    assert loaded.mass == pytest.approx(1.3)
    body = loaded.links[0].body
    assert body.mass == pytest.approx(0.3)
    assert body.com.z == pytest.approx((0.2 * -0.1 + 0.1 * -0.3) / 0.3)
    # two points 0.2 m apart: reduced mass times the distance squared
    assert body.inertia.xx == pytest.approx(0.2 * 0.1 / 0.3 * 0.2**2)
    on_top = Payload(mass=0.1, frame="top").held_by(tip_vehicle())
    assert on_top.base.mass == pytest.approx(1.1)
    assert on_top.links[0].body.mass == 0.2


@pytest.mark.parametrize("payload", [{"mass": -0.1}, {"mass": 0.1, "frame": "hand"}])
def test_an_impossible_payload_is_refused(payload):
    with pytest.raises(RecordError):
        Payload(**payload).held_by(tip_vehicle())


def turbulent(velocity, **more):
    blowing = {
        "mode": "moving_air",
        "velocity": velocity,
        "turbulence": {"altitude": 6.0, "wind_20ft": 7.7} | more,
    }
    return estimated(environment={"wind": blowing})


def test_turbulence_of_an_altitude_follows_a_replaced_mean_wind():
    for end in ([0.0, 10.0, 0.0], [0.2, 0.0, 0.0], [0.0, 0.0, 0.0], [-3.0, 4.0, 1.0]):
        there = turbulent(end, minimum_airspeed=0.5).environment.wind.turbulence
        paths = {f"environment.wind.velocity.{i}": end[i] for i in range(3)}
        found = with_numbers(
            turbulent([1.0, 0.0, 0.0], minimum_airspeed=0.5), paths
        ).environment.wind.turbulence
        assert tuple(found.direction_W) == pytest.approx(
            tuple(there.direction_W), abs=1e-15
        )
        assert found.airspeed == pytest.approx(there.airspeed, rel=1e-15)
        assert (found.intensity, found.scale_length) == (
            there.intensity,
            there.scale_length,
        )


def test_an_airspeed_that_is_stated_stays():
    paths = {
        "environment.wind.velocity.1": 10.0,
        "environment.wind.turbulence.airspeed": 3.0,
    }
    assert (
        with_numbers(
            turbulent([1.0, 0.0, 0.0]), paths
        ).environment.wind.turbulence.airspeed
        == 3.0
    )
    unit = Dryden(
        intensity=Vec3(1.0, 1.0, 1.0), scale_length=Vec3(9.0, 9.0, 9.0), airspeed=3.0
    )
    wind = MovingAir(velocity_W=Vec3(5.0, 0, 0), turbulence=unit)
    assert wind.with_followers([("velocity_W", "y")]) is wind
    # nor does another number of the wind move an airspeed
    low = MovingAir(turbulence=low_altitude(6.0, 7.7, 5.0))
    assert (
        low.with_followers([("turbulence", "intensity", "x"), ("gust", "start")]) is low
    )
