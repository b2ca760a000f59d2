"""A load at the tip, learned from the observed disturbance and made a part of the law's
model.
"""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest

import skyarm
from skyarm import dynamics
from skyarm.algebra import Mat3, Motion, Quaternion, Vec3
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.controller import ControllerError, learns_load
from skyarm.control.law_estimates import found_by_law
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.contact.load import (
    LoadGains,
    LoadMemory,
    hang,
    learn_load,
    load_gains,
    missing,
)
from skyarm.control.model import Model
from skyarm.records.leaves import leaves
from skyarm.reference import Reference
from skyarm.sensing.measurement import blank_measurement
from skyarm.vehicle.linkage import Body

DT, STEP, G = 0.005, 0.04, 9.81
GAINS = LoadGains(limit=0.6)
STRAIGHT = skyarm.load_vehicle("hexarotor_arm6")
GRASP = Quaternion(0.8, 0.3, -0.4, 0.2).normalized().rotation()
"""Axes of a tip that are none of its link's."""
ARM = dataclasses.replace(
    STRAIGHT, frames=(dataclasses.replace(STRAIGHT.frame(), rotation=GRASP),)
)
JOINTS = (0.2, -0.6, -0.97, 0.3, -0.8, 0.4)
TILTED = Quaternion(0.98, 0.1, -0.15, 0.05).normalized().rotation()
TURNED = Quaternion(0.7, 0.7, 0.1, 0.0).normalized().rotation()
MODEL = Model(vehicle=ARM, gravity=G)
NONE = GAINS.start(ARM.n)
LAW = make_centroidal(MODEL).par
AT_TIP = (0.0, 0.0, 0.0)


def weight_of(load, R, joints):
    """What a load at the tip does to base and joints at rest, by the difference of two
    inverse dynamics.
    """
    up = Motion(Vec3(0.0, 0.0, 0.0), R.apply_T(Vec3(0.0, 0.0, G)))
    still = (0.0,) * ARM.n
    found = []
    for vehicle in (ARM, ARM.with_body(ARM.frame().link, load)):
        force, efforts = dynamics.inverse_dynamics(
            vehicle, joints, Vec3(0.0, 0.0, 0.0), still, up, still
        )
        found.append([*R.apply(force.force), *force.torque, *efforts])
    lost = np.subtract(*found)
    return Disturbance(
        force=Vec3(*lost[:3]), torque=Vec3(*lost[3:6]), efforts=tuple(lost[6:])
    )


def at_tip(mass, place):
    frame = ARM.frame()
    return Body(mass=mass, com=frame.position + frame.rotation.apply(Vec3(*place)))


def test_mass_and_torque_about_the_tip_are_those_of_the_load_that_hangs_there():
    place = Vec3(0.02, -0.01, 0.015)
    at = hang(ARM, TILTED, JOINTS, G)
    mass, *torque = missing(
        ARM, GAINS, at, weight_of(at_tip(0.3, place), TILTED, JOINTS)
    )
    expected = np.cross([*at.tip.apply(place)], [0.0, 0.0, -0.3 * G])
    # a little of the torque is held for weight
    assert mass == pytest.approx(0.3, rel=0.02)
    assert torque == pytest.approx(expected[:2], abs=0.1 * np.linalg.norm(expected))
    alone = missing(
        ARM, GAINS, at, weight_of(at_tip(0.3, (0.0, 0.0, 0.0)), TILTED, JOINTS)
    )
    assert alone == pytest.approx([0.3, 0.0, 0.0], abs=1e-12)


def test_the_missing_force_is_the_least_squares_and_a_sliding_joint_has_its_length():
    last = ARM.links[-1]
    slide = dataclasses.replace(
        last, joint=dataclasses.replace(last.joint, kind="prismatic")
    )
    vehicle, trust = (
        dataclasses.replace(ARM, links=(*ARM.links[:-1], slide)),
        GAINS.errors,
    )
    at, rng = hang(vehicle, TILTED, JOINTS, G), np.random.default_rng(8)
    numbers = (0.1 * rng.normal(size=6 + ARM.n)).tolist()
    d = Disturbance(
        force=Vec3(*numbers[:3]), torque=Vec3(*numbers[3:6]), efforts=tuple(numbers[6:])
    )
    rows = np.array(
        [
            [at.lift, 0.0, 0.0],
            *np.transpose([[*each] for each in at.turning]),
            *at.efforts,
        ],
        dtype=float,
    )
    errors = np.array(
        [1.0, *[trust.base] * 3, *[trust.turning] * (ARM.n - 1), trust.sliding]
    )
    held = np.diag([1e-6, 1.0 / GAINS.twist, 1.0 / GAINS.twist])
    told = np.array([*numbers[2:]]) / errors
    expected = np.linalg.lstsq(
        np.vstack([rows / errors[:, None], held]), [*told, 0.0, 0.0, 0.0], rcond=None
    )[0]
    assert missing(vehicle, GAINS, at, d) == pytest.approx(expected, rel=1e-8)


def test_of_wind_across_and_of_a_wrong_thrust_little_is_taken_for_a_load():
    at = hang(ARM, TILTED, JOINTS, G)
    still = (0.0,) * ARM.n
    across, thrust = (
        missing(
            ARM,
            GAINS,
            at,
            Disturbance(force=Vec3(*f), torque=Vec3(0.0, 0.0, 0.0), efforts=still),
        )
        for f in ((2.0, 2.0, 0.0), (0.0, 0.0, -4.0))
    )
    assert across[0] == 0.0
    assert 0.0 < thrust[0] < 0.002  # 4 N are 0.4 kg; the joints know better


@cache
def rows_of(R):
    """Disturbances of 1 kg at the tip and of 1 kg m along each of its axes, as numbers;
    R is TILTED or TURNED.
    """
    one = [
        weight_of(at_tip(1.0, place), R, JOINTS)
        for place in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
    ]
    rows = np.array([[*d.force, *d.torque, *d.efforts] for d in one], dtype=float)
    return rows - np.array([[0.0], [1.0], [1.0], [1.0]]) * rows[0]


def learned(load, seconds, memory=NONE, R=TILTED, holds=True, learns=1.0, beside=None):
    """The load after some time in which the observer holds what the model lacks."""
    for _ in range(round(seconds / STEP)):
        mass, place = load
        modelled = GAINS.inertia_share * memory.mass
        lacks = [
            mass - modelled,
            *(
                mass * c - modelled * k
                for c, k in zip(place, memory.place, strict=True)
            ),
        ]
        d = (np.array(lacks) @ rows_of(R)).tolist()
        d = Disturbance(force=Vec3(*d[:3]), torque=Vec3(*d[3:6]), efforts=tuple(d[6:]))
        d = d if beside is None else d + beside
        memory, _ = learn_load(
            GAINS, memory, MODEL, hang(ARM, R, JOINTS, G), d, holds, learns, 27.0, STEP
        )
    return memory


def test_the_mass_comes_within_a_tenth_of_a_second_and_its_place_in_a_second():
    place = (0.02, -0.01, 0.0)
    soon = learned((0.3, AT_TIP), 0.1)
    first = learned((0.3, AT_TIP), STEP)
    assert first.mass == pytest.approx(
        0.3 * (1.0 - np.exp(-1.5 * 27.0 * STEP)), rel=1e-2
    )
    assert 0.28 < soon.mass < 0.3
    assert learned((0.3, place), 4.0).mass == pytest.approx(0.3, rel=1e-3)
    late = learned((0.3, place), 6.0)
    down = np.array([*hang(ARM, TILTED, JOINTS, G).tip.apply_T(Vec3(0.0, 0.0, 1.0))])
    off = np.array([*late.place]) - place
    # along the weight it cannot be known
    assert off - down * (off @ down) == pytest.approx(np.zeros(3), abs=1e-4)
    turned = learned((0.3, place), 6.0, memory=late, R=TURNED)
    assert [*turned.place] == pytest.approx(place, abs=1e-3)


def test_mass_and_place_have_bounds():
    found = learned((0.6, (0.2, 0.0, 0.0)), 2.0)
    assert learned((1.0, AT_TIP), 0.2).mass == 0.6
    assert max(map(abs, found.place)) == 0.05
    assert learned((-0.2, AT_TIP), 0.1, memory=found).mass < 0.4
    assert learned((-0.2, AT_TIP), 0.1).mass == 0.0  # what pushes up is no load


def test_noise_moves_a_known_mass_by_a_tenth_and_no_place_is_learned_from_far_off():
    known = dataclasses.replace(NONE, mass=0.3)
    pace = 1.0 - np.exp(-1.5 * 27.0 * STEP)
    for off, share in ((1e-4, 0.1), (-0.29, 1.0)):
        moved = learned((0.3 + off, AT_TIP), STEP, memory=known).mass - 0.3
        assert moved == pytest.approx(pace * share * off, rel=0.02)
    # 5 % of the mass and of the least that tells its place count half
    half = 0.05 * (0.3 + 0.2 * 0.6)
    assert learned(
        (0.3 - half, AT_TIP), STEP, memory=known
    ).mass - 0.3 == pytest.approx(-0.55 * pace * half, rel=0.02)
    settled, far = (
        learned((m, (0.02, 0.0, 0.0)), STEP, memory=known).place.x for m in (0.3, 0.6)
    )
    assert far < 0.01 * settled


def test_a_load_that_lies_on_something_is_not_pressed_down():
    up = weight_of(at_tip(0.5, AT_TIP), TILTED, JOINTS)
    held = dataclasses.replace(NONE, mass=0.1)

    def answered(factor, **told):
        d = Disturbance(
            force=up.force * factor,
            torque=up.torque * factor,
            efforts=tuple(e * factor for e in up.efforts),
        )
        wish = {"holds": True, "learns": 1.0} | told
        _, rests = learn_load(
            GAINS,
            held,
            MODEL,
            hang(ARM, TILTED, JOINTS, G),
            d,
            *wish.values(),
            27.0,
            STEP,
        )
        left = d + rests
        return [*left.force, *left.torque, *left.efforts], [
            *d.force,
            *d.torque,
            *d.efforts,
        ]

    # 0.5 kg less than modelled: of 0.1 kg the model has 0.08 kg, which may be wrong,
    # and 0.42 kg push up
    left, _ = answered(-1.0)
    assert left == pytest.approx(
        [-0.2 * GAINS.inertia_share * c for c in (*up.force, *up.torque, *up.efforts)],
        abs=1e-9,
    )
    for factor, told in (
        (1.0, {}),
        (-0.1, {}),
        (-1.0, {"holds": False}),
        (-1.0, {"learns": 0.0}),
    ):
        left, whole = answered(factor, **told)
        assert left == pytest.approx(whole, abs=1e-9)


def test_a_light_load_tells_little_of_its_place():
    off = [learned((mass, (0.02, 0.0, 0.0)), 0.2).place for mass in (0.01, 0.4)]
    small, large = (np.linalg.norm([*each]) for each in off)
    assert small < 0.1 * large


def test_what_is_there_without_a_load_is_no_load():
    wind = Disturbance(
        force=Vec3(0.3, 0.0, -1.0), torque=Vec3(0.0, 0.1, 0.0), efforts=(0.1,) * ARM.n
    )
    nothing = (0.0, AT_TIP)
    calm = learned(nothing, 8.0, holds=False, beside=wind)
    assert (calm.mass, calm.place) == (0.0, Vec3(0.0, 0.0, 0.0))
    assert calm.bias.force.z == pytest.approx(
        -1.0 * (1.0 - np.exp(-0.5 * 8.0)), rel=1e-6
    )
    assert calm.bias.efforts[2] == pytest.approx(0.1, rel=0.05)
    found = learned((0.3, AT_TIP), 0.5, memory=calm, beside=wind)
    assert found.mass == pytest.approx(0.3, rel=1e-2)
    assert found.bias == calm.bias
    gone = learned(nothing, STEP, memory=found, holds=False)
    assert (gone.mass, gone.place) == (0.0, Vec3(0.0, 0.0, 0.0))
    for holds in (True, False):
        assert learned((0.3, AT_TIP), 0.1, memory=calm, holds=holds, learns=0.0) == calm


def test_the_model_holds_the_load_with_its_inertia():
    memory = LoadMemory(mass=0.3, place=Vec3(0.02, 0.0, 0.01), bias=NONE.bias)
    gains = dataclasses.replace(GAINS, size=0.03)
    M = [
        np.array(dynamics.mass_matrix(vehicle, Mat3.identity(), JOINTS))
        for vehicle in (
            gains.adjust_gains(memory, LAW, STEP).model.vehicle,
            LAW.model.vehicle.with_body(
                ARM.frame().link, at_tip(GAINS.inertia_share * 0.3, (0.02, 0.0, 0.01))
            ),
        )
    ]
    # a ball beside a point: the same but for its own inertia in all that turns it
    assert M[0][:3, :3] == pytest.approx(M[1][:3, :3])
    assert (M[0] - M[1])[3:6, 3:6] == pytest.approx(0.3 * 0.03**2 * np.eye(3))
    assert M[0][-1, -1] - M[1][-1, -1] == pytest.approx(0.3 * 0.03**2)


def test_the_observer_bears_the_weight_that_the_model_leaves_out():
    """Against two inverse dynamics, and: where mass and place are right, nothing is
    missing.
    """
    place = (0.02, -0.01, 0.03)
    left = hang(ARM, TILTED, JOINTS, G).weight(0.3, Vec3(*place))
    has = weight_of(at_tip(0.3, place), TILTED, JOINTS)
    for a, b in (
        (left.force, has.force),
        (left.torque, has.torque),
        (left.efforts, has.efforts),
    ):
        assert [*a] == pytest.approx([*b], abs=1e-12)
    known = dataclasses.replace(NONE, mass=0.3, place=Vec3(*place))
    again = learned((0.3, place), 2.0, memory=known)
    assert (again.mass, *again.place) == pytest.approx((0.3, *place), abs=1e-9)


@pytest.mark.parametrize(
    ("name", "share"), [("hexarotor_arm6", 0.8), ("hummingbird_arm2", 1.0)]
)
def test_only_of_a_hand_on_a_wrist_the_model_has_less_than_the_load(name, share):
    assert load_gains(0.5, skyarm.load_vehicle(name)).inertia_share == share


def test_a_vehicle_whose_joints_slide_has_no_wrist():
    links = tuple(
        dataclasses.replace(
            link, joint=dataclasses.replace(link.joint, kind="prismatic")
        )
        for link in STRAIGHT.links
    )
    assert (
        load_gains(0.5, dataclasses.replace(STRAIGHT, links=links)).inertia_share == 1.0
    )


def test_it_is_left_out_by_default_and_does_nothing_where_nothing_is_held():
    model = MODEL
    off, on = (make_centroidal(model, mode="tip", load=limit) for limit in (0.0, 0.5))
    assert off.memory.parts.load == ()
    assert off.par.parts.load is None
    assert off.memory == make_centroidal(model, mode="tip").memory
    assert (
        off.par.parts.adaptation.load is None,
        on.par.parts.adaptation.load is None,
    ) == (False, True)
    reading, held = blank_measurement(ARM.n, len(ARM.rotors)), (0.0,) * ARM.n
    reference = Reference(joints=held, joint_rates=held, joint_accelerations=held)
    first = [
        each.law(each.memory, reading, reference, DT, par=each.par)
        for each in (off, on)
    ]
    assert [*first[0][1].efforts] == pytest.approx([*first[1][1].efforts], abs=1e-12)
    assert first[1][0].parts.load == on.memory.parts.load
    told = dataclasses.replace(reference, load=(1.0,))
    assert off.law(off.memory, reading, told, DT, par=off.par)[1] == first[0][1]


def test_without_gravity_no_weight_tells_of_a_mass():
    pulled = Disturbance(
        force=Vec3(0.1, 0.0, -2.0), torque=Vec3(0.0, 0.1, 0.0), efforts=(0.2,) * ARM.n
    )
    model = dataclasses.replace(MODEL, gravity=0.0)
    for holds in (False, True):
        at = hang(model.vehicle, TILTED, JOINTS, model.gravity)
        memory, rests = learn_load(
            GAINS, NONE, model, at, pulled, holds, 1.0, 27.0, STEP
        )
        assert (memory.mass, rests.force.z) == (0.0, 0.0)
        assert np.isfinite([*memory.place]).all()


def test_a_law_of_ones_own_may_call_anything_load():
    @dataclasses.dataclass(frozen=True)
    class Own:
        load: object

    for load in (0.3, (0.1, 0.2), NONE.bias, ()):
        assert found_by_law(Own(load=load)) == {}
        assert not learns_load(Own(load=load))
    assert found_by_law(Own(load=NONE)) == {
        "load_mass_found": (0.0,),
        "load_place_found": (0.0, 0.0, 0.0),
    }
    assert learns_load(Own(load=GAINS))


@pytest.mark.parametrize("limit", [-0.1, float("nan"), 1e4, "much", True, [0.5]])
def test_other_limits_are_refused_in_one_line(limit):
    with pytest.raises(ControllerError, match=r"controller\.load = ") as error:
        make_centroidal(MODEL, mode="tip", load=limit)
    assert "\n" not in str(error.value)


def test_a_vehicle_without_an_arm_has_no_load_to_learn():
    with pytest.raises(ControllerError, match=r"controller\.load = 0\.5: must be 0"):
        make_centroidal(
            Model(vehicle=skyarm.load_vehicle("tilted_hexarotor"), gravity=G), load=0.5
        )


def test_without_a_mass_the_bandwidths_are_the_laws_own():
    """To the bit."""
    changed = GAINS.adjust_gains(NONE, LAW, DT)
    for name in ("base", "center", "joint_gains", "tip", "observer"):
        assert leaves(getattr(changed, name)) == leaves(getattr(LAW, name))


@pytest.mark.parametrize("mass", [0.03, 0.12, 0.6])
def test_with_a_heavy_load_the_bandwidths_are_085_of_that(mass):
    """Stiffness by the square. Half of it at a fifth of the limit; all of it with a
    mass without bound.
    """
    changed = GAINS.adjust_gains(dataclasses.replace(NONE, mass=mass), LAW, DT)
    share = 1.0 - 0.15 * mass**2 / (mass**2 + 0.12**2)
    assert changed.base.attitude.x == pytest.approx(share**2 * LAW.base.attitude.x)
    assert changed.base.rate.x == pytest.approx(share * LAW.base.rate.x)
    assert changed.joint_gains.damping == pytest.approx(
        [share * each for each in LAW.joint_gains.damping]
    )
    assert changed.observer.joints == pytest.approx(share * LAW.observer.joints)
    heavy = GAINS.adjust_gains(dataclasses.replace(NONE, mass=1e4), LAW, DT)
    assert heavy.base.rate.x == pytest.approx(0.85 * LAW.base.rate.x)
