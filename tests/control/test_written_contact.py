"""The page on the centroidal law is enough to write its parts of contact, load and
accelerometer again.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import written_contact as written
from scipy.spatial.transform import Rotation
from written_contact import Arm
from written_vehicle import vehicle_of

import skyarm
from skyarm.algebra import Mat3, Quaternion, Vec3
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks import disturbance_observer, force_control, stale_readings
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.blocks.tip_force import ForceErrors, levers, tip_force
from skyarm.control.laws.centroidal.contact import admittance, interaction, load
from skyarm.control.model import Model
from skyarm.sensing.measurement import blank_measurement

DT, G = 0.005, 9.81
ARM = skyarm.load_vehicle("hummingbird_arm2")
TWIN = vehicle_of(
    Path(skyarm.__file__).parent / "vehicle" / "library" / "hummingbird_arm2.toml"
)


def vec(a: Any) -> Vec3:
    return Vec3(*(float(each) for each in a))


def record(d: Any) -> Disturbance:
    return Disturbance(
        force=vec(d[0]), torque=vec(d[1]), efforts=tuple(map(float, d[2]))
    )


def flat(d: Any) -> Any:
    return np.concatenate(
        [d.force, d.torque, d.efforts] if isinstance(d, Disturbance) else [*d]
    ).astype(float)


def poses(seed: int, count: int) -> Iterator[tuple[Any, Any, Any]]:
    """Slowly wandering attitudes, with joints and a generator of the rest."""
    draw = np.random.default_rng(seed)
    turn, q = np.zeros(3), np.array([-0.4, -0.9])
    for _ in range(count):
        turn, q = (
            0.99 * turn + draw.normal(0.0, 0.02, 3),
            q + draw.normal(0.0, 0.004, 2),
        )
        yield Rotation.from_rotvec(turn).as_matrix(), q, draw


def mat(R: Any) -> Mat3:
    return Mat3(*(vec(row) for row in R))


def test_the_tip_s_force_is_written() -> None:
    for R, q, draw in poses(1, 20):
        d = draw.normal(0.0, 1.0, 3), draw.normal(0.0, 0.1, 3), draw.normal(0.0, 0.1, 2)
        own = tip_force(ForceErrors(), levers(ARM, mat(R), tuple(q)), record(d))
        assert np.allclose(Arm(TWIN, R, q).force(d), [*own], rtol=0, atol=1e-9)


@pytest.mark.parametrize("seed", [2, pytest.param(3, marks=pytest.mark.thorough)])
def test_interaction_is_written(seed: int) -> None:
    """Pushes that touch, press, slide, bounce and end, at forces that wander with the
    order.
    """
    gains = force_control.InteractionGains(touch=0.3, lost=0.1)
    memory, own = (
        force_control.first_interaction(2),
        written.Interaction(2, 0.3, 0.1, DT),
    )
    seen, wall = set(), np.zeros(3)
    for k, (R, q, draw) in enumerate(poses(seed, 660)):
        asked, course = (
            100 <= k % 400 < 330,
            (0.02 if k % 400 > 240 else 0.005 * (k % 400 > 180)),
        )
        slides = course > 0.01
        told = written.unit(np.array([-1.0, 0.1, 0.05]))
        push = (1.0 if asked else 0.0), 0.2, told
        v = draw.normal(0.0, 0.03, 3) - (0.15 * told if k % 97 < 4 else 0.0)
        most, gap = 0.85 + 0.2 * draw.random(), draw.normal(0.0, 0.003)
        there = 120 <= k % 400 < 340 and k % 111 > 12
        if k % 111 > 8 and k % 111 < 40:  # comes back fast
            v = v - (0.15 + told @ v) * told
        if k == 510:  # has looked for the surface for long
            own.s, memory = -0.49, dataclasses.replace(memory, shift=-0.49)
        wall = 0.9 * wall + 0.1 * (
            1.3 * told + draw.normal(0.0, 0.6, 3) if there else 0.0
        )
        then, now = Arm(TWIN, R, q), Arm(TWIN, R, q + 0.01)
        d = written.plus(
            then.load(wall),
            (
                draw.normal(0.2, 0.05, 3),
                draw.normal(0, 0.002, 3),
                draw.normal(0, 0.0005, 2),
            ),
        )
        u = tuple(draw.normal(0.0, 0.1, each.shape) for each in d)

        at, ahead = levers(ARM, mat(R), tuple(q)), levers(ARM, mat(R), tuple(q + 0.01))
        normal = interaction.estimated_normal(vec(told), memory.lean)
        wanted = force_control.DesiredContact(
            force=push[0], speed=push[1], normal=normal
        )
        moving = interaction.motion_share(
            gains, memory.moving, vec(course * np.array([0.0, 0.6, -0.8])), DT
        )
        memory = dataclasses.replace(memory, gap=gap, moving=moving)
        effort = 0.0 if slides else most
        memory, pressing = force_control.interact(
            gains,
            memory,
            wanted,
            record(d),
            at,
            -float(normal.dot(vec(v))),
            effort,
            DT,
            moving=moving,
        )
        lean = interaction.update_lean(
            memory.lean,
            normal,
            vec(v),
            gains.tilting,
            wanted.presses,
            slides and memory.share > 1.0 - 1e-9,
            DT,
        )
        memory = dataclasses.replace(memory, lean=lean)
        given = pressing.with_order(record(u), at, ahead)

        found, shift, n, gamma, damping = own.step(
            push, d, u, then, now, v, most, course, gap
        )
        assert np.allclose(flat(found), flat(given), rtol=0, atol=1e-9), k
        assert np.allclose(
            [*shift, gamma, *n],
            [*pressing.shift, pressing.share, *pressing.n],
            rtol=0,
            atol=1e-9,
        )
        assert damping == pressing.damping
        assert np.allclose(flat(own.bias), flat(memory.bias), rtol=0, atol=1e-9)
        seen |= {
            ("contact", own.contact),
            ("gamma", gamma in (0.0, 1.0)),
            ("damping", damping),
            ("lean", n[2] != told[2]),
        }
    assert len(seen) == 8


def test_admittance_is_written() -> None:
    M, D, K = (
        np.array([1.0, 0.5, 2.0]),
        np.array([6.0, 20.0, 3.0]),
        np.array([9.0, 400.0, 0.0]),
    )
    tip = admittance.Compliance(
        inertia=tuple(M), damping=tuple(D), stiffness=tuple(K), lead=0.06
    )
    gains = admittance.AdmittanceGains(tip=tip)
    memory, own, far = gains.start(2), written.Admittance(2, M, D, K, 0.06, DT), 0.0
    blank = disturbance_observer.first_observed(2, (0.0,) * 4)
    for k, (R, q, draw) in enumerate(poses(4, 700)):
        at = Arm(TWIN, R, q)
        push = np.array([1.0, -0.4, 0.3]) if 450 < k < 600 else np.zeros(3)
        d = written.plus(
            at.load(push),
            (
                draw.normal(0.2, 0.05, 3),
                draw.normal(0, 0.002, 3),
                draw.normal(0, 0.0005, 2),
            ),
        )
        w, *xyz = np.roll(Rotation.from_matrix(R).as_quat(), 1)
        observed = dataclasses.replace(
            blank,
            quaternion=Quaternion(w, *xyz),
            joints=tuple(q),
            **{
                name: getattr(record(d), name)
                for name in ("force", "torque", "efforts")
            },
        )
        memory, moved = admittance.shift_reference(
            gains, memory, ARM, observed, [Taylor((0.0,) * 5)] * 3, (), DT
        )
        theirs = [[each.derivative(i) for each in moved] for i in range(3)]
        shift = own.step(d, at)
        assert np.allclose(shift, theirs, rtol=0, atol=1e-9), k
        far = max(far, np.abs(shift[0]).max())
    assert far > 0.02


@pytest.mark.parametrize(
    "wrist", [True, pytest.param(False, marks=pytest.mark.thorough)]
)
def test_load_is_written(wrist: bool) -> None:
    model = Model(vehicle=ARM, gravity=G)
    gains = load.LoadGains(limit=0.3, inertia_share=0.8 if wrist else 1.0)
    memory, own, rests = gains.start(2), written.Load(2, 0.3, 20.0, G, DT, wrist), 0.0
    for k, (R, q, draw) in enumerate(poses(5, 500)):
        at, holds = Arm(TWIN, R, q), 100 <= k < 450
        missing = (0.15 if k < 350 else -0.4) - own.m if holds else 0.0
        d = written.plus(
            at.load(-G * missing * written.UP),
            (
                draw.normal(0.2, 0.05, 3),
                draw.normal(0, 0.002, 3),
                draw.normal(0, 0.0005, 2),
            ),
        )
        there = load.hang(model.vehicle, mat(R), tuple(q), model.gravity)
        memory, resting = load.learn_load(
            gains, memory, model, there, record(d), float(holds), 1.0, 20.0, DT
        )
        taken = own.step(d, holds, at)
        assert np.allclose(flat(taken), flat(resting), rtol=0, atol=1e-7), k
        assert np.allclose(
            [own.m, *own.c], [memory.mass, *memory.place], rtol=0, atol=1e-8
        )
        assert np.allclose(
            own.shares(at),
            gains.unknown_shares(ARM, tuple(q), memory.mass),
            rtol=0,
            atol=1e-9,
        )
        rests = max(rests, -taken[0][2])
    assert rests > 1.0


def test_the_accelerometer_is_written() -> None:
    """Readings about the accepted difference and the largest acceleration, some
    repeated, some of zeros.
    """
    gains = disturbance_observer.AccelerometerGains(force=30.0, velocity=5.0)
    own = written.Accelerometer(30.0, 5.0, 0.05)
    b, v, agreed, seldom = np.zeros(3), np.zeros(3), 1.0, np.zeros(4)
    model = Model(vehicle=ARM, gravity=G)
    for k, (R, _, draw) in enumerate(poses(6, 300)):
        a, thrust, change, alone = draw.normal(0.0, 1.0, (4, 3))
        # of what it should read; a third of all is wrong, and at last the bias is
        # beyond its bound
        off = draw.normal(0.0, [3.0, 0.3, 0.3, 0.3][k % 4] if k < 200 else 0.05, 3) + (
            k > 200
        ) * np.array([9.0, 0, -7.0])
        y = (
            R.T @ (a + G * written.UP)
            + thrust
            + own.b
            + off * draw.choice([1.0, 1.0, 5.0])
        )
        measured = own.v + a * DT + draw.normal(0.0, 0.06 if k % 40 > 20 else 0.005, 3)
        new, free = (
            draw.choice([1.0, 1.0, 1.0, 0.0], 2),
            float(draw.choice([1.0, 0.0, 1.0])),
        )
        if k % 11 == 10:
            y = np.zeros(3)
        if k % 40 == 0:
            agreed = own.used = 1.0
        if k == 200:
            own.b = b = np.array([4.99, 0.0, -4.99])
        before = disturbance_observer.TranslationEstimate(
            velocity=vec(alone),
            bias=vec(b),
            change=vec(change),
            agreed=agreed,
            integrated=vec(v),
        )
        seen = dataclasses.replace(
            blank_measurement(2, 4), velocity=vec(measured), specific_force=vec(y)
        )
        flags = stale_readings.Fresh(
            position=1.0,
            quaternion=1.0,
            velocity=new[0],
            rate=1.0,
            specific_force=new[1],
            joints=1.0,
            joint_rates=1.0,
        )
        modelled = disturbance_observer.modelled_specific_force(
            model, mat(R), vec(a), vec(thrust * float(ARM.mass))
        )
        felt = disturbance_observer.measure_translation(
            gains, before, seen, mat(R), vec(a), modelled, (1.0, free), flags, DT
        )
        wanted = own.step(y, measured, new, alone, change, free, R, a, thrust, G, DT)
        found = [[*felt.velocity], [*felt.change], felt.heard, [*felt.beside]]
        for each, other in zip(wanted, found, strict=True):
            assert np.allclose(each, other, rtol=0, atol=1e-9), k
        b, v, agreed = (
            np.array([*felt.bias]),
            np.array([*felt.integrated]),
            felt.agreed,
        )
        assert np.allclose(
            [*own.b, *own.v, own.used], [*b, *v, agreed], rtol=0, atol=1e-9
        ), k
        large = float(np.linalg.norm(wanted[3]))
        seldom += [
            own.used < 0.9,
            own.used > 0.999,
            large > 10.0,
            np.abs(own.b).max() == 5.0,
        ]
    assert seldom.min() > 5
