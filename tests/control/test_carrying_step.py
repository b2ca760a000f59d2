"""When the load is learned: while it is told to be held, on no surface, and with no
actuator at its limit.
"""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from law_parts import with_parts

import skyarm
from skyarm.algebra import Mat3, Quaternion, Vec3
from skyarm.control.blocks import force_control
from skyarm.control.blocks.force_control import (
    InteractionGains,
    Pressing,
    first_interaction,
    wanted_of,
)
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.blocks.tip_force import levers
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.parameters import Step
from skyarm.control.laws.centroidal.step_records import Effect
from skyarm.control.model import Model
from skyarm.dynamics.kinematics import frame_pose
from skyarm.reference import Reference
from skyarm.sensing.measurement import blank_measurement

DT = 0.005
ARM = skyarm.load_vehicle("hummingbird_arm2_rotors")
LAW = make_centroidal(
    Model(vehicle=ARM, gravity=9.81), mode="tip", interaction=(0.3, 0.1), load=0.3
)
AT = levers(ARM, Mat3.identity(), (0.0, 0.0))
PULLED = AT.disturbance(Vec3(0.0, 0.0, -0.981))


def pressing(**changes):
    held = {
        "n": Vec3(-1.0, 0.0, 0.0),
        "share": 0.0,
        "damping": 20.0,
        "engaged": 0.0,
        "shift": (0.0, 0.0, 0.0),
    }
    return Pressing(
        **held
        | {"order": 0.0, "beyond": 0.0, "force": Vec3(0.0, 0.0, 0.0), "kept": 1.0}
        | changes
    )


def mass(told=1.0, on=None, **memory):
    """What is learned in a period of a weight of 100 g."""
    return carried(LAW.par, dataclasses.replace(LAW.memory, **memory), told, on).mass


def carried(par, memory, told, on, alone=PULLED, unknown=None, effects=None):
    """Memory of the load after a period in which the observer holds its pull."""
    zero = Vec3(0, 0, 0)
    none = Disturbance(force=zero, torque=zero, efforts=(0, 0))
    step = Step(
        par=par,
        vehicle=par.model.vehicle,
        memory=memory,
        measurement=blank_measurement(2, 4),
        reference=Reference(load=(told,)),
        dt=DT,
        timing=None,
        motion=None,
        seen=SimpleNamespace(observed=memory.observed, alone=alone),
        state=None,
    )
    before = Effect(
        signals=(),
        unknown=none if unknown is None else unknown,
        force=none.force,
        pressing=on,
    )
    load, effect = par.parts.load.affect(memory.parts.load, step, before)
    if effects is not None:
        effects.append(effect)
    return load


def test_a_load_is_learned_while_it_is_told_to_be_held_and_no_surface_is_touched():
    assert mass() == pytest.approx(0.1 * 0.183, rel=0.05)  # 1 - exp(-1.5 * 27 * 0.005)
    assert mass(on=pressing()) == mass()
    assert mass(told=0.4) == 0.0
    for on in (pressing(engaged=1.0), pressing(asked=True)):
        assert mass(on=on) == 0.0


def test_a_load_under_a_tilted_base_is_learned_by_the_estimated_attitude():
    tilted = Quaternion(np.cos(0.3), 0.6 * np.sin(0.3), 0.8 * np.sin(0.3), 0.0)
    pulled = levers(ARM, tilted.rotation(), (0.0, 0.0)).disturbance(
        Vec3(0.0, 0.0, -0.981)
    )
    observed = dataclasses.replace(LAW.memory.observed, quaternion=tilted)
    memory = dataclasses.replace(LAW.memory, observed=observed)
    assert carried(LAW.par, memory, 1.0, None, pulled).mass == pytest.approx(
        mass(), rel=1e-9
    )


def test_a_load_is_learned_as_fast_as_the_slower_observer_lets_it():
    for force, joints in ((27.0, 60.0), (60.0, 27.0), (27.0, 27.0)):
        observer = dataclasses.replace(LAW.par.observer, force=force, joints=joints)
        par = dataclasses.replace(LAW.par, observer=observer)
        assert carried(par, LAW.memory, 1.0, None).mass == pytest.approx(
            0.1 * (1.0 - np.exp(-1.5 * 27.0 * DT)), rel=0.05
        )


def test_nothing_is_learned_at_a_limit_and_of_a_command_that_others_changed():
    assert mass(free=(1.0, 0.0, 1.0)) == 0.0
    assert mass(free=(0.0, 1.0, 1.0)) == 0.0
    assert mass(applied=(1.0, 1.0, 0.0)) == 0.0


def test_joints_near_the_tip_leave_a_load_its_inertia_and_turn_their_links_gently():
    """A straight arm of two links of 150 mm, and a tip that counts as near up to 200
    mm; 100 g of up to 300 g held.
    """
    part = dataclasses.replace(LAW.par.parts.load, bulk=0.2)
    memory = with_parts(
        LAW.memory, load=dataclasses.replace(LAW.memory.parts.load, mass=0.1)
    )
    none = AT.disturbance(Vec3(0.0, 0.0, 0.0))
    disturbed, effects = dataclasses.replace(none, efforts=(0.3, -0.2)), []
    carried(with_parts(LAW.par, load=part), memory, 1.0, None, none, disturbed, effects)
    shares = [
        0.1**2 / (0.1**2 + 0.06**2) * 0.2**4 / (lever**4 + 0.2**4)
        for lever in (0.3, 0.15)
    ]
    efforts = [
        (1.0 - share) * each
        for share, each in zip(shares, disturbed.efforts, strict=True)
    ]
    assert effects[0].unknown.efforts == pytest.approx(efforts, rel=1e-3)
    assert effects[0].links == pytest.approx(
        [1.0 - 0.6 * share for share in shares], rel=1e-3
    )


def test_what_is_left_of_a_contact_is_no_bias_and_hinders_no_mass():
    def after(free, told):
        touched = dataclasses.replace(LAW.memory.parts.interaction, free=free)
        return carried(
            LAW.par, with_parts(LAW.memory, interaction=touched), told, pressing()
        )

    assert (after(0.45, 0.0).bias.force.z, after(0.45, 1.0).mass) == (0.0, mass())
    assert after(0.55, 0.0).bias.force.z == pytest.approx(
        -0.981 * (1.0 - np.exp(-0.5 * DT))
    )


def test_what_a_support_bears_of_a_load_is_answered_as_if_nobody_had_observed_it():
    """The load is believed to be 100 g; 400 g of upward force less than nothing is what
    it lies on.
    """
    still, instant, joints = (0.0, 0.0), 1e-9, (0.4, -1.1)
    reading = dataclasses.replace(blank_measurement(2, 4), joints=joints)
    reference = Reference(
        joints=joints, joint_rates=still, joint_accelerations=still, load=(1.0,)
    )
    held, at = (
        dataclasses.replace(LAW.memory.parts.load, mass=0.1),
        levers(ARM, Mat3.identity(), joints),
    )

    def period(newton):
        """Efforts, and the rate of the force that the posture follows; rotors' lags
        have no time in an instant.
        """
        d = at.disturbance(Vec3(0.0, 0.0, newton))
        observed = dataclasses.replace(
            LAW.memory.observed,
            joints=joints,
            force=d.force,
            torque=d.torque,
            efforts=d.efforts,
        )
        memory = with_parts(
            dataclasses.replace(LAW.memory, started=1.0, observed=observed), load=held
        )
        after, command = LAW.law(memory, reading, reference, instant, par=LAW.par)
        return np.array([*command.efforts, after.slow_force.z / instant])

    pushed, rests, free = (period(9.81 * kilogram) for kilogram in (0.5, 0.1, 0.0))
    assert pushed == pytest.approx(rests, rel=1e-5)
    # a load that is lighter than the model has it is answered
    assert np.abs(rests - free)[:2].max() > 0.05
    assert rests[2] == pytest.approx(LAW.par.tip.shift_rate * 0.981, rel=1e-3)


def test_the_weight_of_a_known_load_is_no_push_on_a_surface():
    model, still = Model(vehicle=ARM, gravity=9.81), (0.0, 0.0)
    law = make_centroidal(
        model, mode="tip", interaction=(0.3, 0.1), force_sensor=True, load=0.3
    )
    knows = with_parts(
        law.memory, load=dataclasses.replace(law.memory.parts.load, mass=0.05)
    )
    joints = (0.4, -1.1)
    weighs = frame_pose(ARM, ARM.frame(), joints).R.apply_T(
        Vec3(0.0, 0.0, -0.05 * 9.81)
    )
    reading = dataclasses.replace(
        blank_measurement(2, 4), joints=joints, tip_force=(*weighs,)
    )
    reference = Reference(
        joints=joints,
        joint_rates=still,
        joint_accelerations=still,
        push=(1.0, 0.1, -1.0, 0.0, 0.0),
        load=(1.0,),
    )
    felt = [
        law.law(memory, reading, reference, DT, par=law.par)[0].parts.interaction.felt
        for memory in (law.memory, knows)
    ]
    assert felt[0].z == pytest.approx(-0.05 * 9.81 * (1.0 - np.exp(-60.0 * DT)))
    assert [*felt[1]] == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)


def test_what_a_sensor_reads_is_turned_to_world_axes_and_filtered():
    law = make_centroidal(
        Model(vehicle=ARM, gravity=9.81),
        mode="tip",
        interaction=(0.3, 0.1),
        force_sensor=True,
    )
    joints, read = (0.4, -1.1), Vec3(0.5, 0.2, -0.3)
    still = (0.0,) * 2
    reading = dataclasses.replace(
        blank_measurement(2, 4), joints=joints, tip_force=(*read,)
    )
    reference = Reference(
        joints=joints,
        joint_rates=still,
        joint_accelerations=still,
        push=(1.0, 0.1, -1.0, 0.0, 0.0),
    )
    following, _ = law.law(law.memory, reading, reference, DT, par=law.par)
    expected = frame_pose(ARM, ARM.frame(), joints).R.apply(read) * (
        1.0 - np.exp(-60.0 * DT)
    )
    assert [*following.parts.interaction.felt] == pytest.approx([*expected], rel=1e-6)


def test_a_sensor_decides_on_touch_and_leads_the_integral():
    gains, none = (
        InteractionGains(touch=0.3, lost=0.1, sensing=60.0),
        first_interaction(2, sensor=True),
    )
    nothing = Disturbance(
        force=Vec3(0.0, 0.0, 0.0), torque=Vec3(0.0, 0.0, 0.0), efforts=(0.0, 0.0)
    )
    wish, there = wanted_of((1.0, 0.1, -1.0, 0.0, 0.0)), Vec3(-0.8, 0.0, 0.0)

    def stepped(memory, felt):
        return force_control.interact(
            gains, memory, wish, nothing, AT, 0.0, 0.0, DT, felt
        )[0]

    assert (stepped(none, there).touching, stepped(none, None).touching) == (1.0, 0.0)
    pressed = dataclasses.replace(none, touching=1.0, share=1.0)
    assert stepped(pressed, there).integral == pytest.approx(4.0 * DT * 0.2)
    assert stepped(pressed, None).integral == pytest.approx(4.0 * DT * 1.0)
    assert stepped(none, there).felt == there
    # a law that hears nothing keeps what it has
    assert stepped(none, None).felt == none.felt


def test_a_tip_that_still_goes_in_touches_again_70_ms_after_the_loss():
    gains, dt = InteractionGains(touch=0.3, lost=0.1, sensing=60.0), 0.001
    nothing = Disturbance(
        force=Vec3(0.0, 0.0, 0.0), torque=Vec3(0.0, 0.0, 0.0), efforts=(0.0, 0.0)
    )
    wish, there = wanted_of((1.0, 0.1, -1.0, 0.0, 0.0)), Vec3(-0.8, 0.0, 0.0)
    now = dataclasses.replace(
        first_interaction(2, sensor=True),
        touching=1.0,
        share=1.0,
        found=1.0,
        losing=0.999,
    )
    touching = []
    for _ in range(90):
        now, _ = force_control.interact(
            gains, now, wish, nothing, AT, 0.2, 0.0, dt, there
        )
        touching.append(now.touching)
    assert touching.index(0.0) == 0  # it went through
    assert touching.index(1.0) * dt == pytest.approx(
        gains.rebound + gains.fall, abs=2.0 * dt
    )
