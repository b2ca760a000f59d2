"""The safety layer's limits by default, against docs/scenario_safety.md and the
vehicle by hand; and their ends.
"""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path

import pytest

import skyarm
from skyarm.control.catalogue import make_controller
from skyarm.control.controller import ControllerError
from skyarm.control.model import Model
from skyarm.control.safety.limits import limits_for
from skyarm.scenario.controller_table import under_law
from skyarm.scenario.in_flight import stretches
from skyarm.simulate.batch import Batch
from skyarm.simulate.lane_numbers import MeasuredLimitsWarning
from skyarm.simulate.loop import run_in_python
from support.pages import cells_of

GRAVITY = 9.1
VEHICLE = skyarm.load_vehicle("octo_coaxial_two_arms")
"""A turning torso, and two arms of a shoulder and a sliding forearm each: both kinds of
joints."""

KINDS = tuple(link.joint.kind for link in VEHICLE.links)
PULL = {"stiffness": 5.0, "damping": 2.7}

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = (DOCS / "scenario_safety.md").read_text("utf-8")
TABLE = "".join(
    re.findall(
        r"<!-- generated: words controller.safety [^\n]*-->\n(.*?)<!-- /generated -->",
        PAGE,
        re.S,
    )
)

BY_KIND = {
    "joint_step": (0.5, 0.05),
    "joint_slew": (3.0, 0.3),
    "joint_speed": (12.0, 1.5),
    "joint_margin": (0.05, 0.005),
    "trusted_joint_error": (0.6, 0.1),
    "lost_joint_speed": (48.0, 6.0),
}
"""Of a revolute joint (rad) and of a prismatic one (m)."""


def limits_of(vehicle, **options):
    controller = make_controller(
        "hybrid_computed_torque", Model(vehicle=vehicle, gravity=GRAVITY)
    )
    return limits_for(dataclasses.replace(controller, **options), **PULL)


def by_kind(name, kinds=KINDS):
    return tuple(BY_KIND[name][kind == "prismatic"] for kind in kinds)


def test_the_defaults_are_those_of_the_page():
    found = limits_of(VEHICLE)
    page = {
        "tilt": math.radians(40.0),
        "climb": GRAVITY / 2.0,
        "speed": 4.0,
        "step": 0.4,
        "step_speed": 1.5,
        "joint_pole": 25.0,
        "trusted_tilt": math.radians(70.0),
        "trusted_rate": 12.0,
        "lost_rate": 40.0,
        "lost_speed": 15.0,
        "patience": 0.25,
        "calm": math.inf,
    }
    for name, value in page.items():
        assert getattr(found, name) == pytest.approx(value, rel=1e-15), name
        assert f"`{name}`" in TABLE
    for name in BY_KIND:
        assert getattr(found, name) == pytest.approx(by_kind(name), rel=1e-15), name
        assert f"`{name}`" in TABLE
    shown = {
        row[0].strip("`"): re.sub(r" \(\d+ degrees\)$", "", row[2]).strip("`")
        for row in cells_of(TABLE)
        if len(row) > 2
    }
    for name, value in page.items():
        if name not in ("climb", "calm"):
            assert float(shown[name]) == pytest.approx(value, abs=5e-4), name
    assert shown["climb"] == "half of gravity"
    assert shown["calm"] == "inf`: never"
    for name, (turning, sliding) in BY_KIND.items():
        if name == "lost_joint_speed":
            assert shown[name] == "four times `joint_speed"
        else:
            assert shown[name].startswith(f"{turning:g} or {sliding:g}"), name
    assert shown["trusted_joint_error"].endswith(
        "; 1.5 or 0.3 for a law that keeps the tip on its reference"
    )


def test_a_law_that_keeps_the_tip_is_trusted_with_larger_joint_errors():
    found = limits_of(VEHICLE, keeps_tip=True).trusted_joint_error
    assert found == tuple(0.3 if kind == "prismatic" else 1.5 for kind in KINDS)


def test_limits_are_measured_on_a_law_that_estimates_no_lag():
    """Its memory has no gentle start to skip; it pulls as one that finds no lag."""
    model = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"))
    with_estimate, without = (
        limits_for(make_controller("centroidal", model, **options))
        for options in ({}, {"lag": (0.0, 0.0)})
    )
    assert without.stiffness == pytest.approx(with_estimate.stiffness, rel=1e-6)
    assert without.damping == pytest.approx(with_estimate.damping, rel=1e-6)


def test_efforts_are_the_models_and_change_over_their_range_in_five_milliseconds():
    found = limits_of(VEHICLE)
    efforts = tuple(float(link.joint.effort_limit) for link in VEHICLE.links)
    assert len(set(efforts)) > 1
    assert found.effort == efforts
    assert [slew * 0.005 for slew in found.effort_slew] == pytest.approx(list(efforts))


def test_the_margin_of_a_short_joint_is_a_tenth_of_its_range():
    short = VEHICLE.with_joints(lower=-0.01, upper=0.02)
    # a tenth of 0.03 is 0.003: less than either kind's usual margin
    assert limits_of(short).joint_margin == pytest.approx([0.003] * len(KINDS))


def with_top_speeds(*tops):
    """The Hummingbird with these highest speeds, the last for all rotors that are
    left.
    """
    vehicle = skyarm.load_vehicle("hummingbird_arm2")
    every = [*tops, *[tops[-1]] * (len(vehicle.rotors) - len(tops))]
    rotors = tuple(
        dataclasses.replace(r, max_speed=top)
        for r, top in zip(vehicle.rotors, every, strict=True)
    )
    return dataclasses.replace(vehicle, rotors=rotors)


def hover_speed(vehicle):
    """All rotors alike, the centre of mass on their axis in the model's zero pose: m
    g / 4 on each.
    """
    mass = sum(float(body.mass) for body in vehicle.bodies)
    return math.sqrt(
        mass * GRAVITY / (4.0 * float(vehicle.rotors[0].thrust_coefficient))
    )


def test_rotors_change_over_their_whole_range_in_five_milliseconds():
    assert limits_of(with_top_speeds(800.0)).rotor_slew == pytest.approx(800.0 / 0.005)
    assert limits_of(with_top_speeds(700.0, 900.0, 800.0)).rotor_slew == pytest.approx(
        900.0 / 0.005
    )


def test_a_rotor_without_a_highest_speed_is_taken_to_turn_twice_as_fast_as_in_hover():
    free = with_top_speeds(math.inf)
    hover = hover_speed(free)
    # the trim is solved to 1e-9 of the speeds
    assert limits_of(free).rotor_slew == pytest.approx(2.0 * hover / 0.005, rel=1e-6)
    # one of them free, the others slower or faster than that
    assert limits_of(
        with_top_speeds(math.inf, 1.5 * hover)
    ).rotor_slew == pytest.approx(2.0 * hover / 0.005, rel=1e-6)
    assert limits_of(
        with_top_speeds(math.inf, 3.0 * hover)
    ).rotor_slew == pytest.approx(3.0 * hover / 0.005)


@pytest.mark.parametrize("which", [0, 1])
def test_the_margin_on_both_sides_leaves_half_of_a_joints_range(which):
    vehicle = skyarm.load_vehicle("hummingbird_arm2")
    links = list(vehicle.links)
    links[which] = dataclasses.replace(
        links[which],
        joint=dataclasses.replace(links[which].joint, lower=-1.0, upper=1.0),
    )
    law = make_controller(
        "hybrid_computed_torque",
        Model(vehicle=dataclasses.replace(vehicle, links=tuple(links))),
    )
    margin = [0.05, 0.05]
    margin[which] = 0.5
    assert limits_for(law, joint_margin=margin, **PULL).joint_margin == tuple(margin)
    margin[which] = 0.5001
    with pytest.raises(
        ControllerError,
        match=rf"^safety.joint_margin\[{which}\] = 0.5001: must be at most a quarter",
    ):
        limits_for(law, joint_margin=margin, **PULL)


DOCUMENT = {
    "name": "guarded",
    "duration": 0.2,
    "plant": {"vehicle": "hummingbird_arm2_rotors"},
    "controller": {"law": "hybrid_computed_torque", "safety": True},
    "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 1.0]}},
}


def guarded(safety=True, **words):
    """Scenario in hover with a law in a safety layer."""
    return skyarm.scenario_from(
        DOCUMENT | {"controller": DOCUMENT["controller"] | {"safety": safety, **words}}
    )


def pulls_of(scenario):
    limits = scenario.controller.par.limits
    return limits.stiffness, limits.damping


STIFF = {
    "position": [9.0, 9.0, 32.0],
    "velocity": [5.0, 5.0, 9.0],
    "attitude": [8.0] * 3,
    "rate": [2.0] * 3,
}
AT = "controller.inner.gains"


def test_replaced_gains_have_the_limits_of_a_law_that_is_made_with_them():
    begun = guarded()
    numbers = {
        f"{AT}.{name}.{axis}": row[i]
        for name, row in STIFF.items()
        for i, axis in enumerate("xyz")
    }
    changed, twin = skyarm.with_numbers(begun, numbers), guarded(gains=STIFF)
    assert pulls_of(changed) == pulls_of(twin) != pulls_of(begun)
    assert (
        skyarm.with_numbers(changed, {"plant.gravity": 9.8}).controller
        == changed.controller
    )
    for measured, safety in ((1, {"stiffness": 6.0}), (0, {"damping": 2.5})):
        found = pulls_of(skyarm.with_numbers(guarded(safety), numbers))
        expected = [6.0, 2.5]
        expected[measured] = pulls_of(twin)[measured]
        assert list(found) == expected, "what is stated stays"
    own = skyarm.with_numbers(begun, {"controller.limits.stiffness": 6.0})
    assert pulls_of(skyarm.with_numbers(own, numbers)) == (6.0, pulls_of(twin)[1])


def test_gains_that_change_in_flight_are_measured_in_machine_code_too():
    change = skyarm.Change(at=0.05, path=f"{AT}.position.z", value=32.0)
    changed = dataclasses.replace(guarded(), changes=(change,))
    assert (
        dict(stretches(changed)[1].overrides.data(changed).numbers)[
            "controller.limits.stiffness"
        ]
        > 30.0
    )
    quick, slow = skyarm.run(changed), run_in_python(changed)
    assert (quick.rotor_commands == slow.rotor_commands).all()
    with pytest.warns(
        MeasuredLimitsWarning,
        match=r"^path = 'controller\.inner\.gains\.position\.z': varies, while",
    ):
        Batch(guarded(), [change.path])


def test_another_law_keeps_the_limits_that_are_stated():
    others = (guarded({"stiffness": 7.0}), guarded({"damping": 2.1}), guarded())
    found = [pulls_of(under_law(each, "centroidal_joint")) for each in others]
    (measured,) = found[2:]
    assert found[:2] == [(7.0, measured[1]), (measured[0], 2.1)]


def test_a_saved_file_of_other_gains_has_their_limits(tmp_path):
    changed = skyarm.with_numbers(guarded(), {f"{AT}.position.z": 32.0})
    base = skyarm.save_scenario(tmp_path / "base.toml", guarded(), DOCUMENT)
    found = skyarm.load_scenario(
        skyarm.save_scenario(tmp_path / "found.toml", changed, base)
    )
    assert pulls_of(found) == pulls_of(changed)
