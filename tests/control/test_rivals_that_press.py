"""Two laws of the paper that also press: what they are without a push, what they add
with one, and how they hold it.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.algebra.scalars.fold import data
from skyarm.control.blocks.force_control import Pressing
from skyarm.control.catalogue import make_controller, rescale
from skyarm.control.controller import ControllerError, presses
from skyarm.control.laws.pressing import (
    ObservedContact,
    admittance_motion,
    level_tip,
    observe_contact,
    pressing_command,
    release_normal,
    shift_base,
)
from skyarm.control.model import Model
from skyarm.dynamics.kinematics import frame_pose, jacobian_columns
from skyarm.scenario.controller_table import controller_by_name
from support.laws import MODEL, G, cases, hovering, raw_squares, unclipped, unlimited

DT = 0.005
BASIS = {"hybrid_ct": "hybrid_computed_torque", "admittance_pd": "decoupled_pd"}
CASES = cases(6, seed=5)


@pytest.mark.parametrize("name", BASIS)
def test_without_a_push_they_are_the_papers_laws(name):
    own, basis = (
        make_controller(name, MODEL),
        make_controller(BASIS[name], MODEL, rate_error="corrected"),
    )
    assert presses(own.par)
    for case in CASES:
        args = (case.measurement(), case.reference(), DT)
        following, command = own.law(own.memory, *args, par=own.par)
        assert command == basis.law((), *args, par=basis.par)[1]
        assert following.sent == command


N = Vec3(-0.6, 0.0, 0.8)
FREE = Model(vehicle=unlimited(), gravity=G)


def contact(case, n=N, *, turning=1.0, **changes):
    """What a period of ``hybrid_ct`` knows of a contact, with some of it set; no limit
    is in the way.
    """
    gains = {"gains.attitude": turning, "gains.rate": turning}
    own = unclipped(rescale(make_controller("hybrid_ct", FREE), gains))
    reference = dataclasses.replace(case.reference(), push=(1.0, 0.1, *n))
    touch = observe_contact(own.memory, case.measurement(), reference, DT, own.par)[1]
    parts = {"share": 1.0, "order": 0.0, **changes}
    touch = dataclasses.replace(
        touch, pressing=dataclasses.replace(touch.pressing, **parts)
    )
    return touch, pressing_command(own.par, case.measurement(), reference, touch)


def test_the_order_is_taken_off_joints_torque_and_thrust_by_the_tips_jacobian():
    vehicle = FREE.vehicle
    for case in CASES:
        before, after = (
            contact(case, turning=0.0, order=order)[1] for order in (0.0, 0.5)
        )
        seen = case.measurement()
        R = np.array([[*row] for row in seen.quaternion.rotation().rows])
        force = R.T @ (0.5 * np.array([*N]))
        p = [*frame_pose(vehicle, vehicle.frame(), seen.joints).p]
        columns = [
            [*column.linear]
            for column in jacobian_columns(vehicle, vehicle.frame(), seen.joints)
        ]
        change = raw_squares(after) - raw_squares(before)
        torque, thrust = np.zeros(3), 0.0
        for rotor, square in zip(vehicle.rotors, change, strict=True):
            lift = rotor.thrust_coefficient * square
            torque += np.cross([*rotor.position], [0.0, 0.0, lift])
            torque[2] -= rotor.direction * rotor.moment_coefficient * lift
            thrust += lift
        assert np.subtract(after.efforts, before.efforts) == pytest.approx(
            -np.array(columns) @ force, abs=1e-9
        )
        assert torque == pytest.approx(-np.cross(p, force), abs=1e-9)
        assert thrust == pytest.approx(-force[2], abs=1e-9)


def test_the_base_tilts_for_the_order_and_no_more():
    order = 1.5
    tilt = np.arctan(order / (FREE.vehicle.mass * G))
    tilted = hovering(joints=(-0.45, -0.9), euler=(0.0, tilt, 0.0))
    turns, none = (
        contact(tilted, Vec3(-1.0, 0.0, 0.0), turning=t, order=order)[1]
        for t in (1.0, 0.0)
    )
    assert raw_squares(turns) == pytest.approx(raw_squares(none), rel=1e-9)


def test_the_tip_is_left_damping_alone_along_the_normal():
    for case in CASES:
        touch, _ = contact(case)
        wanted = (30.0, -20.0)
        R = np.array([[*row] for row in case.measurement().quaternion.rotation().rows])
        n = R.T @ np.array([*touch.pressing.n])
        row = np.array([np.dot([*column], n) for column in touch.at.columns])
        found = np.array(release_normal(touch, wanted))
        length, damping = row @ row, float(touch.pressing.damping)
        # as far as joints move the tip there at all
        left = (row @ wanted - damping * touch.into) * 1e-4 / (length + 1e-4)
        assert row @ found == pytest.approx(
            damping * touch.into + left, rel=1e-9, abs=1e-9
        )
        aside = np.array([-row[1], row[0]])
        assert aside @ found == pytest.approx(aside @ wanted)
        assert (
            release_normal(
                dataclasses.replace(
                    touch, pressing=dataclasses.replace(touch.pressing, share=0.0)
                ),
                wanted,
            )
            == wanted
        )


def test_the_tip_that_enters_the_surface_and_the_level_tip_are_those_of_kinematics():
    vehicle, case = MODEL.vehicle, CASES[0]
    touch, _ = contact(case)
    reference = case.reference()
    seen = case.measurement()
    R = np.array([[*row] for row in seen.quaternion.rotation().rows])
    p = np.array([*frame_pose(vehicle, vehicle.frame(), seen.joints).p])
    columns = np.array(
        [[*c.linear] for c in jacobian_columns(vehicle, vehicle.frame(), seen.joints)]
    )
    velocity = np.array([*seen.velocity]) + R @ (
        np.cross([*seen.rate], p) + columns.T @ seen.joint_rates
    )
    assert touch.into == pytest.approx(-np.dot([*touch.pressing.n], velocity))
    arm = np.array([*frame_pose(vehicle, vehicle.frame(), reference.joints).p])
    c, s = np.cos(reference.yaw), np.sin(reference.yaw)
    turned = np.array([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1], arm[2]])
    assert [*level_tip(vehicle, reference)] == pytest.approx(
        np.array([*reference.position]) + turned
    )


def test_the_reference_moves_along_the_normal_and_the_gap_is_the_tips_way_from_it():
    case, own = CASES[1], make_controller("hybrid_ct", FREE)
    reference = dataclasses.replace(case.reference(), push=(1.0, 0.1, *N))
    shifted = shift_base(reference, N, (0.2, -0.3, 0.5))
    n = np.array([*N])
    for word, way in (("position", 0.2), ("velocity", -0.3), ("acceleration", 0.5)):
        assert np.subtract(
            [*getattr(shifted, word)], [*getattr(reference, word)]
        ) == pytest.approx(way * n)
    seen = case.measurement()
    touch = observe_contact(own.memory, seen, reference, DT, own.par)[1]
    following, _ = own.law(own.memory, seen, reference, DT, par=own.par)
    goal = level_tip(FREE.vehicle, shift_base(reference, N, touch.pressing.shift))
    tip = np.array([*(seen.position + touch.at.R.apply(touch.at.tip))])
    assert following.interaction.gap == pytest.approx(n @ (tip - [*goal]))


def driven(along, *, asked=True, seconds=2.0, shift=0.0, force=2.0):
    """The virtual mass under a constant observed force: place, velocity, acceleration
    at the end.
    """
    own = make_controller("admittance_pd", MODEL)
    memory = own.memory
    memory = dataclasses.replace(
        memory, interaction=dataclasses.replace(memory.interaction, shift=shift)
    )
    pressing = Pressing(
        n=Vec3(-1.0, 0.0, 0.0),
        share=1.0,
        damping=53.0,
        engaged=1.0,
        shift=(0.0, 0.0, 0.0),
        order=0.0,
        beyond=0.0,
        force=Vec3(0.0, 0.0, 0.0),
        kept=1.0,
        asked=asked,
    )
    touch = ObservedContact(
        at=None, pressing=pressing, force=force, along=along, speed=0.1, into=0.0
    )
    found = (shift, 0.0, 0.0)
    for _ in range(round(seconds / DT)):
        found = admittance_motion(own.par, memory, touch, DT)
        held = dataclasses.replace(
            memory.interaction, shift=data(found[0]), shift_rate=data(found[1])
        )
        memory = dataclasses.replace(memory, interaction=held)
    return found


def test_the_virtual_mass_comes_with_the_speed_rests_at_the_wanted_force_and_returns():
    assert driven(0.0)[1] == pytest.approx(-0.1, rel=1e-3)
    assert driven(0.0, seconds=0.25)[1] == pytest.approx(
        -0.1 * (1.0 - np.exp(-1.0)), rel=0.03
    )
    assert driven(2.0, shift=-0.2) == pytest.approx((-0.2, 0.0, 0.0))
    assert driven(3.0)[1] == pytest.approx(0.05, rel=1e-3)
    # a hard surface pushes no faster back
    assert driven(200.0)[1] == pytest.approx(0.1, rel=1e-3)
    # at the end of its way it stands
    assert driven(0.0, seconds=6.0)[:2] == (-0.5, 0.0)
    assert abs(driven(0.0, asked=False, shift=-0.2)[0]) < 1e-3
    assert driven(0.0, asked=False, shift=-0.2, seconds=0.25)[0] == pytest.approx(
        -0.2 * 2.0 * np.exp(-1.0), rel=0.03
    )


@pytest.mark.parametrize("name", BASIS)
@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"interaction": (0.1, 0.3)}, "interaction"),
        (
            {"interaction": (0.0, 0.0)},
            "two forces above 0, the second below the first$",
        ),
        ({"interaction": (0.3,)}, "must be 2 numbers"),
        ({"interaction": (10001.0, 0.1)}, "must be at most 10000 N"),
        ({"observer": (1.0, 2.0)}, "observer"),
    ],
)
def test_wrong_options_are_refused_by_name(name, options, words):
    with pytest.raises(ControllerError, match=words) as caught:
        make_controller(name, MODEL, **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", BASIS)
def test_a_vehicle_without_a_tip_is_refused(name):
    with pytest.raises(ControllerError, match="end_effector"):
        make_controller(
            name, Model(vehicle=skyarm.load_vehicle("hummingbird"), gravity=9.81)
        )


@pytest.mark.parametrize(
    "name", ["admittance_pd", pytest.param("hybrid_ct", marks=pytest.mark.thorough)]
)
def test_they_hold_the_wanted_force_of_the_shipped_task(name):
    scenario = skyarm.load_scenario("press_and_hold")
    rival = dataclasses.replace(
        scenario, controller=controller_by_name(scenario, f"{name}_tuned"), duration=5.0
    )
    log = skyarm.run(rival)
    force = log.contact_force[:, 0]
    met = log.time[np.argmax(force > 0.0)]
    assert log.status == "completed"
    assert force[log.time > met + 2.0].mean() == pytest.approx(1.0, abs=0.05)
