"""The axes of the envelope: values are numbers of scenarios, trials are the issue's,
vehicles get what they can.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from skyarm import load_vehicle
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.studies.compare.envelope_axes import AXES
from skyarm.studies.trial.facts import PAPER, setting_of
from skyarm.vehicle.vehicle_files import list_vehicles
from support.cases import sampled

ARMED = [
    name
    for name in list_vehicles()
    if load_vehicle(name).n and not load_vehicle(name).planar
]
BATCHED = [axis for axis in AXES.values() if axis.numbers]


@pytest.mark.parametrize("axis", BATCHED, ids=lambda axis: axis.name)
def test_the_numbers_of_a_value_make_the_scenario_of_that_value(axis):
    setting = setting_of(PAPER, 10.0)
    first, *_, last = axis.of(setting)
    easiest = axis.scenario(setting, first)
    assert easiest != axis.scenario(setting, last)
    made = with_numbers(easiest, axis.numbers_of(setting, last))
    assert with_numbers(easiest, axis.numbers_of(setting, first)) == easiest
    assert dataclasses.replace(made, title="") == dataclasses.replace(
        axis.scenario(setting, last), title=""
    )


def test_noise_is_where_an_axis_says_so():
    setting = setting_of(PAPER, 10.0)
    for axis in AXES.values():
        flown = axis.scenario(setting, axis.of(setting)[1])
        assert (flown.noise.position > 0.0) == axis.noisy, axis.name
        age = (
            axis.of(setting)[1]
            if axis.name == "measurement_delay"
            else 0.005 * axis.noisy
        )
        assert flown.delays.measurement == age, axis.name


def test_the_circle_goes_at_its_speed_about_its_radius():
    setting = setting_of(PAPER, 10.0)
    at = AXES["circle"].scenario(setting, 2.0).reference.at(np.array([6.0, 8.5]))
    assert np.hypot(at.velocity.x, at.velocity.y) == pytest.approx([2.0, 2.0])
    assert np.hypot(at.position.x, at.position.y) == pytest.approx([1.0, 1.0])
    assert AXES["circle"].scenario(setting, 2.0).reference.at(1.9).velocity.x == 0.0


@pytest.mark.parametrize("name", sampled(ARMED, 4))
def test_joints_stay_within_limits_and_other_vehicles_get_motions_that_they_can_fly(
    name,
):
    setting, paper = setting_of(name, 10.0), setting_of(PAPER, 10.0)
    truth = load_vehicle(name)
    times = np.linspace(0.0, 10.0, 2001)
    for axis in (AXES["swing"], AXES["swing_amplitude"], AXES["circle"]):
        flown = axis.scenario(setting, axis.of(setting)[-1])
        for link, signal in zip(truth.links, flown.reference.joints, strict=True):
            angle = np.broadcast_to(signal.derivatives(times)[0], times.shape)
            assert link.joint.lower <= angle.min() <= angle.max() <= link.joint.upper, (
                axis.name,
                link.joint.name,
            )
    weight = float(truth.mass) / float(load_vehicle(PAPER).mass)
    assert AXES["push_x"].of(setting)[-1] == pytest.approx(3.0 * weight, rel=5e-3)
    speeds = AXES["circle"].of(setting)
    assert (speeds[-1] / 3.0) ** 2 == pytest.approx(setting.climb, rel=1e-2)
    assert 0.0 < setting.climb <= paper.climb == 1.0
    assert setting.hover.reference.z.derivatives(0.0)[0] >= 1.5


def test_a_vehicle_without_an_arm_is_refused():
    with pytest.raises(
        ScenarioError, match=r"--vehicle = 'hummingbird': must have an arm"
    ):
        setting_of("hummingbird")


def test_pushes_and_steps_of_wind_are_those_of_the_table():
    setting = setting_of()
    force = AXES["push_y"].scenario(setting, 3.0).forces[0]
    assert force.frame == setting.truth.end_effector
    assert [force.force.at(t).y for t in (3.9, 4.1, 4.6, 5.1, 19.4, 19.6)] == [
        0.0,
        3.0,
        0.0,
        3.0,
        3.0,
        0.0,
    ]
    assert [type(force.force.at(4.1).x), type(force.force.at(4.1).z)] == [
        int,
        int,
    ], "structural zeros"
    wind = AXES["wind_steps"].scenario(setting, 5.0).forces[0].force
    steps = [tuple(map(float, wind.at(t))) for t in (1.0, 4.0, 7.0, 10.0, 13.0, 17.0)]
    assert steps == [(5, 0, 0), (0, 0, 0), (0, 5, 0), (-5, 0, 0), (0, 0, 0), (0, 0, 5)]


def test_the_wind_turns_once_in_its_time_with_its_air():
    flown = AXES["turning_wind"].scenario(setting_of(), 5.0)
    for t, (x, y) in ((0.0, (1, 0)), (1.25, (0, 1)), (2.5, (-1, 0)), (6.25, (0, 1))):
        for vector in (flown.forces[0].force.at(t), flown.air[0].velocity_W.at(t)):
            assert (vector.x, vector.y) == pytest.approx((2.0 * x, 2.0 * y), abs=1e-12)


def test_rotors_become_as_slow_as_the_table_says():
    rotor = AXES["motor_lag"].scenario(setting_of(), 4.0).plant.vehicle.rotors[0]
    assert (rotor.time_constant_up, rotor.time_constant_down) == pytest.approx(
        (0.05, 0.08)
    )


def test_turbulence_has_half_the_mean_and_a_hull_in_it():
    flown = AXES["turbulence"].scenario(setting_of(), 6.0)
    drag = flown.plant.vehicle.drag
    assert 0.5 * drag.air_density * drag.area.x == pytest.approx(0.02)
    assert tuple(flown.wind.turbulence.intensity) == (3.0, 3.0, 3.0)
    assert math.isclose(
        flown.wind.turbulence.scale_length.x / flown.wind.turbulence.airspeed, 0.5
    )


def test_the_figure_is_three_sines_at_multiples_of_its_frequency():
    t = np.linspace(6.0, 10.0, 101)
    at = AXES["figure"].scenario(setting_of(PAPER, 10.0), 0.1).reference.at(t)
    for axis, amplitude, times, phase in (
        ("x", 0.8, 2, 0.0),
        ("y", 0.5, 3, 0.7),
        ("z", 0.15, 5, 1.9),
    ):
        middle = 1.5 if axis == "z" else 0.0
        wanted = middle + amplitude * np.sin(2.0 * np.pi * 0.1 * times * t + phase)
        assert getattr(at.position, axis) == pytest.approx(wanted, abs=1e-12), axis
    assert at.joints[1] == pytest.approx(
        0.3 * np.sin(2.0 * np.pi * 0.7 * t + 1.1), abs=1e-12
    )


def test_a_random_curve_is_the_spline_of_its_points_however_long_it_flies():
    """SciPy's B-spline through the same control points; every time between them has the
    same ones.
    """
    from scipy.interpolate import BSpline

    points = 0.8 * np.random.default_rng(31).uniform(-1.0, 1.0, 66)
    t = np.linspace(5.5, 10.0, 50)
    for step in (1.0, 0.35):
        spline = BSpline(step * (np.arange(72) - 5.0), points, 5)
        for duration in (10.0, 20.0):
            at = (
                AXES["random_curve"]
                .scenario(setting_of(PAPER, duration), step)
                .reference.at(t)
            )
            assert at.position.x == pytest.approx(spline(t), abs=1e-10), (
                step,
                duration,
            )
            assert at.velocity.x == pytest.approx(spline(t, 1), abs=1e-8)
    assert np.abs(at.position.y - at.position.x).max() > 0.1
