"""What the maker of the centroidal law takes and leaves out, and which of its options
it refuses.
"""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest

import skyarm
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.options import VALUES, check_entry, periods_of
from skyarm.control.model import Model
from skyarm.records.files import Fields
from skyarm.reference import Reference
from skyarm.scenario.controller_table import controller_from
from skyarm.sensing.measurement import blank_measurement
from skyarm.vehicle.linkage import BASE

ARM = skyarm.load_vehicle("hummingbird_arm2_rotors")
MODEL = Model(vehicle=ARM, gravity=9.8)
HANDLESS = dataclasses.replace(ARM, end_effector="")
ARMLESS = dataclasses.replace(
    skyarm.load_vehicle("hummingbird"),
    frames=(dataclasses.replace(ARM.frames[0], name="gripper", link=BASE),),
    end_effector="gripper",
)


@pytest.mark.parametrize(
    ("vehicle", "load", "friction"),
    [(ARM, True, True), (HANDLESS, False, True), (ARMLESS, False, False)],
)
def test_a_load_is_learned_by_an_arm_that_has_a_tip_and_friction_by_any_arm(
    vehicle, load, friction
):
    controller = make_centroidal(Model(vehicle=vehicle))
    found = controller.par.parts.adaptation
    learned = (
        (None, False)
        if found is None
        else (found.load, all(high > 0.0 for _, high in found.damping_limits))
    )
    assert learned == (2.0 if load else None, friction)
    # and it flies: a step from the first memory has a command
    n = vehicle.n
    rest = dict.fromkeys(
        ("joints", "joint_rates", "joint_accelerations", "joint_jerks", "joint_snaps"),
        (0.0,) * n,
    )
    measured = blank_measurement(n, 4)
    goal = Reference(
        position=measured.position,
        velocity=measured.velocity,
        acceleration=measured.velocity,
        **rest,
    )
    _, command = controller.law(
        controller.memory, measured, goal.dense(), 0.005, par=controller.par
    )
    assert np.all(np.isfinite([*command.rotor_speeds, *command.efforts]))


@pytest.mark.parametrize("mode", ["joint", "tip"])
def test_a_load_that_shall_not_be_learned_is_not_and_friction_always_is(mode):
    found = make_centroidal(MODEL, mode=mode, adaptation=0.0).par.parts.adaptation
    assert found.load is None
    assert min(high for _, high in found.damping_limits) > 0.0


@pytest.mark.parametrize(
    "vehicle", [HANDLESS, dataclasses.replace(ARMLESS, end_effector="")]
)
def test_a_vehicle_without_a_tip_refuses_what_needs_one(vehicle):
    for options in (
        {"mode": "tip"},
        {"adaptation": 0.3},
        {"mode": "tip", "adaptation": 0.0},
    ):
        with pytest.raises(ControllerError, match="has no end_effector"):
            make_centroidal(Model(vehicle=vehicle), **options)
    assert (
        make_centroidal(Model(vehicle=vehicle), adaptation=0.0).par.parts.adaptation
        is None
        or not vehicle.end_effector
    )


ROWS = [name for name, value in VALUES.items() if isinstance(value, tuple)]


@pytest.mark.parametrize("name", ROWS)
def test_a_row_of_gains_is_as_many_numbers_as_the_usual_one_has(name):
    count = len(VALUES[name])
    assert (
        check_entry(name, [1.0] * count)
        == check_entry(name, (1,) * count)
        == (1.0,) * count
    )
    wrong = (
        *((1.0,) * other for other in (0, count - 1, count + 1)),
        "1" * count,
        b"1" * count,
        1.0,
        None,
        dict.fromkeys(range(count), 1.0),
        set(range(count)),
        np.ones(count),
        iter([1.0] * count),
    )
    for value in wrong:
        with pytest.raises(
            ControllerError,
            match=rf"^controller\.{name} = .*: must be {count} numbers$",
        ):
            check_entry(name, value)
        with pytest.raises(ControllerError, match=rf"controller\.{name} = "):
            make_centroidal(MODEL, **{name: value})


@pytest.mark.parametrize("name", ROWS)
@pytest.mark.parametrize("bad", [-1e-9, float("nan"), float("inf"), True, "1", None])
def test_each_number_of_a_row_is_refused_by_its_place(name, bad):
    count = len(VALUES[name])
    for i in range(count):
        row = [1.0] * count
        # an attitude may be to either side
        row[i] = -1.01 if bad == -1e-9 and name == "attitude" else bad
        with pytest.raises(
            ControllerError, match=re.escape(f"controller.{name}[{i}] = ")
        ):
            check_entry(name, row)


@pytest.mark.parametrize("whole", [0, 1, 2, 7, 100])
@pytest.mark.parametrize("off", [1e-8, 1e-4, 0.0012, 0.0024])
def test_a_delay_off_a_whole_number_of_periods_to_either_side_is_refused(whole, off):
    assert periods_of(whole * 0.005, 0.005) == whole
    for seconds in (whole * 0.005 - off, whole * 0.005 + off):
        if 0.0 < seconds < 0.5:
            with pytest.raises(
                ControllerError, match="must be a whole number of control periods"
            ):
                periods_of(seconds, 0.005)


def test_a_measurement_older_than_the_whole_delay_is_refused():
    assert (
        make_centroidal(MODEL, delay=0.01, age=0.01).par
        == make_centroidal(MODEL, delay=0.01).par
    )
    with pytest.raises(
        ControllerError,
        match=r"^controller\.age = 0\.01: must be at most delay, 0\.005 s$",
    ):
        make_centroidal(MODEL, delay=0.005, age=0.01)


@pytest.mark.parametrize("given", [{"delay": 0.005, "age": 0.01}, {"age": 0.015}])
def test_a_table_whose_age_is_beyond_its_delay_is_refused(given):
    """The loop's own age, 10 ms, is no more than a shorter delay that a table states as
    a model error.
    """
    table, known = (
        {"law": "centroidal", **given},
        {
            "control_period": 0.005,
            "delay": 0.01,
            "age": 0.01,
        },
    )
    with pytest.raises(
        ValueError, match=rf"^controller\.age = {given['age']}: must be at most delay, "
    ):
        controller_from(Fields(table, "controller"), MODEL, None, known)
    for late in (0.0, 0.005, 0.01, 0.02):
        told = {"law": "centroidal", "delay": late}
        made = controller_from(Fields(told, "controller"), MODEL, None, known)
        assert made.par == make_centroidal(MODEL, delay=late, age=min(late, 0.01)).par


@pytest.mark.parametrize("period", [0.001, 0.0025, 0.005, 0.01])
def test_rounding_of_a_decimal_delay_loses_no_period(period):
    """0.145 / 0.005 is 28.999999999999996."""
    assert [periods_of(round(k * period, 6), period) for k in range(101)] == list(
        range(101)
    )


def test_slow_motors_track_the_rate_of_a_force_slowly():
    """With the root of the paper's mean lag over the slowest motor's, unless a
    bandwidth is given.
    """
    slow, quick = (
        Model(vehicle=skyarm.load_vehicle(name))
        for name in ("hexarotor12_arm5", "pelican_arm2")
    )
    lag = max(
        0.5 * (float(r.time_constant_up) + float(r.time_constant_down))
        for r in slow.vehicle.rotors
    )
    bandwidths = [
        make_centroidal(model, mode="tip").par.parts.trend.bandwidth
        for model in (slow, quick)
    ]
    assert bandwidths == pytest.approx([20.0 * (0.01875 / lag) ** 0.5, 20.0])
    assert make_centroidal(slow, force_trend=13.0).par.parts.trend.bandwidth == 13.0
    assert make_centroidal(slow, force_trend=0.0).par.parts.trend is None


@pytest.mark.parametrize("mode", ["tip", "joint"])
def test_a_vehicle_that_picks_loads_filters_its_accelerometer_more_unless_stated(mode):
    def heard(**options):
        gains = make_centroidal(MODEL, mode=mode, **options).par.observer.accelerometer
        return gains and (gains.force, gains.velocity)

    assert heard() == (40.0, 8.0)
    assert heard(load=0.3) == (30.0, 8.0)
    assert heard(load=0.3, accelerometer=(44.0, 7.0)) == (44.0, 7.0)
    assert heard(load=0.3, accelerometer=(0.0, 0.0)) is None


def test_a_preview_reaches_beyond_the_period_of_the_reference_or_is_none():
    """Its first sample, an eighth of it, is to come whenever within a period the law
    asks.
    """

    def preview(**options):
        return make_centroidal(MODEL, mode="tip", **options).par.tip.preview

    assert (preview(preview=0.16), preview(preview=0.0), preview()) == (
        0.16,
        None,
        pytest.approx(0.6),
    )
    assert preview(reference_period=0.1) == pytest.approx(0.8)
    assert preview(reference_period=0.5) is None
    # the commands are known to be late by three periods more
    assert preview(delay=0.03, age=0.015, preview=0.28) == 0.28
    for options, least in (({}, 0.16), ({"delay": 0.03, "age": 0.015}, 0.28)):
        words = (
            f"^controller.preview = 0.15: must be 0, or at least {least} s, 8 times the"
            " sum of the reference's period and the delay of commands$"
        )
        with pytest.raises(ControllerError, match=words):
            make_centroidal(MODEL, mode="tip", preview=0.15, **options)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            {"adaptation": 0.3, "load": 0.2},
            "controller.adaptation = 0.3: must be 0 with load, which is what",
        ),
        (
            {"adaptation": 0.3, "tip_mass_limit": 0.0},
            "controller.tip_mass_limit = 0.0: must be above 0 with",
        ),
    ],
)
def test_a_stated_adaptation_that_would_learn_nothing_is_refused(options, words):
    with pytest.raises(ControllerError, match=f"^{re.escape(words)}"):
        make_centroidal(MODEL, **options)


def test_an_option_that_vehicle_or_another_option_forbids_is_refused_by_its_own_name():
    bare, arm = (
        Model(vehicle=skyarm.load_vehicle(name))
        for name in ("hummingbird", "hummingbird_arm2")
    )
    with pytest.raises(
        ControllerError,
        match=r"^controller.adaptation = 0.3: must be 0: 'hummingbird' has no end_eff",
    ):
        make_centroidal(bare, adaptation=0.3)
    # the tip's damping is what is left along the normal of a surface
    with pytest.raises(
        ControllerError,
        match=r"^controller.tip\[1\] = 0.0: must be above 0 with interaction$",
    ):
        make_centroidal(arm, mode="tip", interaction=(0.3, 0.1), tip=(700.0, 0.0))
    file = Fields({"law": "centroidal_tip"}, "controller")
    with pytest.raises(ValueError, match=r"it is a preset: preset = 'centroidal_tip'"):
        controller_from(file, arm, None, {})
