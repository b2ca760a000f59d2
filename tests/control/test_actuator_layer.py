"""The layer between a law and servos inverts the believed servo at the mean of the
motion while the setpoint acts.

A law under safety, on rotors that tilt and on servos is looked into as deep as it
stands.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from law_parts import with_parts

import skyarm
from skyarm.algebra import Sym3, Vec3
from skyarm.control.actuator_layer import with_actuators, with_consequences
from skyarm.control.catalogue import make_controller
from skyarm.control.controller import innermost, with_innermost
from skyarm.control.law_estimates import lags_found, observed_push
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.parameters import CentroidalParameters
from skyarm.control.model import Model
from skyarm.control.onboard.export_c import _on_torque
from skyarm.control.safety import with_safety_layer
from skyarm.control.vectored_layer import pairs_model, with_tilting
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.servo import PositionServo
from skyarm.dynamics.actuators.tilting import turn_rotors
from skyarm.plant.interface import Truth
from skyarm.reference import hover
from skyarm.scenario.scenario_checks import check_scenario
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensing.measurement import blank_measurement
from skyarm.studies.stability.frozen_scenario import without_adaptation
from skyarm.studies.stability.hover_delay import believed_delay
from skyarm.vehicle.linkage import Body, Joint, Link
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.vehicle.vehicle_records import MountedDrive

INERTIA, EFFORT, Q, QD = 2e-3, 0.03, 0.4, -1.5


def arm_on(servo: PositionServo) -> tuple[Any, Any]:
    """A law that wants 0.03 N m of a joint of 2 g m^2 on a base that stays, and a
    measurement.
    """
    heavy = Body(mass=1e9, inertia=Sym3(1e9, 1e9, 1e9, 0, 0, 0))
    arm = Body(mass=1e-3, inertia=Sym3(INERTIA, INERTIA, INERTIA, 0, 0, 0))
    link = Link(
        name="arm", parent=-1, joint=Joint(name="j", axis=Vec3(0, 0, 1)), body=arm
    )
    rotors = load_vehicle("hummingbird_arm2").rotors
    vehicle = dataclasses.replace(
        load_vehicle("hummingbird_arm2"),
        base=heavy,
        links=(link,),
        frames=(),
        end_effector="",
        drives=(MountedDrive(name="j", drive=servo),),
    )
    model = Model(vehicle=vehicle, gravity=0.0)

    def law(memory: Any, measurement: Any, reference: Any, dt: Any, *, par: Any) -> Any:
        return memory, Command(rotor_speeds=(0.0,) * len(rotors), efforts=(EFFORT,))

    inner = dataclasses.replace(
        make_controller("decoupled_pd", model), law=law, memory=()
    )
    made = with_actuators(inner, model, 0.005)
    return made, dataclasses.replace(
        blank_measurement(1, len(rotors)), joints=(Q,), joint_rates=(QD,)
    )


def stepped(servo: PositionServo) -> tuple[Any, float]:
    """Memory and setpoint after one step of the law of :func:`arm_on`."""
    made, reading = arm_on(servo)
    reference: Any = None
    memory, command = made.law(made.memory, reading, reference, 0.005, par=made.par)
    return memory, float(command.efforts[0])


@pytest.mark.parametrize("latency", [0.0, 0.003, 0.012])
def test_the_setpoint_gives_the_torque_on_average_while_it_acts(latency):
    servo = PositionServo(stiffness=9.0, damping=0.2, inertia=INERTIA, latency=latency)
    _, setpoint = stepped(servo)
    t = latency + (np.arange(20_000) + 0.5) / 20_000 * 0.005
    q, qd = Q + QD * t + 0.5 * EFFORT / INERTIA * t**2, QD + EFFORT / INERTIA * t
    mean = np.mean(9.0 * (setpoint - q) - 0.2 * qd)
    assert mean == pytest.approx(EFFORT, rel=1e-6)


def test_the_belief_of_a_servo_begins_where_the_joint_is():
    """With setpoints on their way that hold it there, not at zero."""
    memory, _ = stepped(
        PositionServo(
            stiffness=9.0, damping=0.2, inertia=INERTIA, latency=0.005, integral=4.0
        )
    )
    (servo,) = memory.drives
    assert servo.goal == pytest.approx(Q + EFFORT / 9.0)
    assert servo.integral == pytest.approx(EFFORT / 9.0 * 0.005)


def test_a_law_on_servos_may_have_its_safety_layer_inside():
    """The belief stands once, for all layers: each finds it when the controller is
    made.
    """
    vehicle, servo = (
        load_vehicle("hummingbird_arm2"),
        PositionServo(stiffness=9.0, damping=0.2, inertia=INERTIA),
    )
    drives = tuple(
        MountedDrive(name=link.joint.name, drive=servo) for link in vehicle.links
    )
    model = Model(vehicle=dataclasses.replace(vehicle, drives=drives))
    guarded = with_safety_layer(
        make_controller("centroidal", model), {"stiffness": 8.0, "damping": 4.0}
    )
    made = with_actuators(guarded, model, 0.005)
    assert made.name == "guarded_centroidal_joint"
    assert made.par.inner.inner.model is None


def held(servo: PositionServo, noise: float = 0.0) -> list[tuple[float, float]]:
    """Position and setpoint of a joint that a surface holds at rest, period by period
    for 2 s.
    """
    made, reading = arm_on(servo)
    draws, memory, found = np.random.default_rng(3), made.memory, []
    reference: Any = None
    for _ in range(400):
        seen = dataclasses.replace(
            reading, joints=(Q + noise * draws.standard_normal(),), joint_rates=(0.0,)
        )
        memory, command = made.law(memory, seen, reference, 0.005, par=made.par)
        found.append((Q, float(command.efforts[0])))
    return found


@pytest.mark.parametrize("latency", [0.0, 0.012])
def test_a_joint_that_a_surface_holds_gets_the_torque_of_the_law(latency):
    """The model would move it; the acceleration that it lacks is observed, and the
    setpoint that of a joint at rest.
    """
    servo = PositionServo(stiffness=9.0, damping=0.2, inertia=INERTIA, latency=latency)
    pairs = held(servo)
    torques = [9.0 * (setpoint - q) for q, setpoint in pairs]
    assert torques[0] > 1.05 * EFFORT  # predicted to run ahead
    assert torques[-1] == pytest.approx(EFFORT, rel=1e-4)


def test_a_stiff_servo_does_not_turn_the_noise_of_its_encoder_into_torque():
    servo = PositionServo(stiffness=90.0, damping=0.2, inertia=INERTIA)
    torque = [90.0 * (setpoint - q) for q, setpoint in held(servo, noise=1e-3)][100:]
    assert np.mean(torque) == pytest.approx(EFFORT, abs=0.02)
    assert np.std(torque) < 0.6 * 90.0 * 1e-3


ANGLES = (0.4, -0.3, 0.2, 0.5, -0.4, 0.3)
TURNED = load_vehicle("voliro_like")


def setpoints(vehicle, measured, believed=None):
    """Setpoints of the two joints of a vehicle on rotors that push sideways, or on
    fixed ones that do the same.
    """
    servo = PositionServo(stiffness=9.0, damping=0.2, inertia=INERTIA)
    drives = tuple(
        MountedDrive(name=link.joint.name, drive=servo) for link in vehicle.links
    )
    model = Model(vehicle=vehicle)

    def law(memory: Any, measurement: Any, reference: Any, dt: Any, *, par: Any) -> Any:
        return memory, Command(rotor_speeds=(480.0,) * 6, efforts=(EFFORT, -EFFORT))

    def none(
        memory: Any, measurement: Any, reference: Any, dt: Any, *, par: Any
    ) -> Any:
        return memory, Command(rotor_speeds=(480.0,) * 12, efforts=(EFFORT, -EFFORT))

    if believed is None:
        inner = dataclasses.replace(
            make_controller("decoupled_pd", model), law=law, memory=()
        )
    else:
        fixed = make_controller("decoupled_pd", pairs_model(model))
        inner = with_tilting(dataclasses.replace(fixed, law=none, memory=()), model)
        inner = dataclasses.replace(
            inner, memory=dataclasses.replace(inner.memory, angles=believed)
        )
    made = with_actuators(
        inner, Model(vehicle=dataclasses.replace(vehicle, drives=drives)), 0.005
    )
    reading = dataclasses.replace(
        blank_measurement(2, 6), rotor_speeds=(500.0,) * 6, tilts=measured
    )
    reference: Any = None
    return made.law(made.memory, reading, reference, 0.005, par=made.par)[1].efforts


def test_rotors_that_tilt_push_along_their_turned_axes_on_the_joints_too():
    fixed = setpoints(turn_rotors(TURNED, ANGLES), ())
    level = setpoints(TURNED, ())
    assert np.abs(np.subtract(fixed, level)).max() > 1e-6
    assert setpoints(TURNED, ANGLES) == pytest.approx(fixed, abs=1e-12)
    # without a measurement, or with one that is no number, the law's belief
    assert setpoints(TURNED, (), ANGLES) == pytest.approx(fixed, abs=1e-12)
    broken = (float("nan"), *ANGLES[1:])
    assert setpoints(TURNED, broken, ANGLES) == pytest.approx(fixed, abs=1e-12)


SERVO = PositionServo(stiffness=9.0, damping=0.2, inertia=0.01)
LIMITS = {"stiffness": 8.0, "damping": 4.0}


def layered(kind, **options):
    """A guarded law that adapts, on rotors that tilt or on servos or on both."""
    vehicle = skyarm.load_vehicle("voliro_like")
    options = {"mode": "tip", "sideways": 0.9 * ("tilts" in kind)} | options
    law = with_safety_layer(make_centroidal(Model(vehicle=vehicle), **options), LIMITS)
    if "servos" not in kind:
        return law
    drives = tuple(
        MountedDrive(name=link.joint.name, drive=SERVO) for link in vehicle.links
    )
    return with_actuators(
        law, Model(vehicle=dataclasses.replace(vehicle, drives=drives)), 0.005
    )


def planned(law):
    """A hover under a law."""
    vehicle = law.par.model.vehicle
    trajectory = hover((0.0, 0.0, 2.0), joints=(0.0,) * vehicle.n)
    return Scenario(
        name="hover",
        duration=0.1,
        plant=Truth(vehicle=vehicle),
        controller=law,
        reference=trajectory,
    )


@pytest.mark.parametrize("kind", ["tilts", "servos", "tilts and servos"])
def test_the_law_itself_is_found_under_two_layers_and_three(kind):
    law = layered(kind, delay=0.01)
    own = innermost(law.par)
    assert isinstance(own, CentroidalParameters)
    assert with_innermost(law.par, own) == law.par
    assert lags_found(law.memory) == (0.0, 0.0)
    assert observed_push(law.memory) is None
    presses = layered(kind, interaction=(0.3, 0.1)).memory
    pushed = dataclasses.replace(
        innermost(presses).parts.interaction, force=Vec3(1.0, 2.0, 3.0)
    )
    told = with_innermost(presses, with_parts(innermost(presses), interaction=pushed))
    assert observed_push(told) == Vec3(1.0, 2.0, 3.0)
    flown = planned(law)
    assert believed_delay(flown) == pytest.approx(0.01)
    still = innermost(without_adaptation(flown).controller.par)
    assert own.parts.adaptation.load is not None
    assert still.parts.adaptation.load is None


ROTORS = ("par", "model", "vehicle", "rotors")


@pytest.mark.parametrize("kind", ["tilts", "servos", "tilts and servos"])
def test_a_rotor_number_replaced_by_its_own_value_changes_nothing(kind):
    law = layered(kind)
    assert with_consequences(law, [(*ROTORS, 0, "thrust_coefficient")], 0.005) == law


def test_a_slower_tilt_servo_is_led_by_its_lag_over_that_of_the_motor():
    law = layered("tilts and servos")
    vehicle = law.par.model.vehicle
    slow = (
        0.045,
        0.001,
        9.0,
        *(float(tilt.time_constant) for tilt in vehicle.tilts[3:]),
    )
    rotors = [
        dataclasses.replace(r, tilt=dataclasses.replace(r.tilt, time_constant=t))
        for r, t in zip(vehicle.rotors, slow, strict=True)
    ]
    model = dataclasses.replace(
        law.par.model, vehicle=dataclasses.replace(vehicle, rotors=tuple(rotors))
    )
    changed = dataclasses.replace(law, par=dataclasses.replace(law.par, model=model))
    places = [(*ROTORS, i, "tilt", "time_constant") for i in range(3)]
    found = with_consequences(changed, places, 0.005).par.inner.lead
    lags = [
        0.5 * float(r.time_constant_up + r.time_constant_down) for r in vehicle.rotors
    ]
    np.testing.assert_allclose(
        found, np.clip(np.array(slow) / lags, 1.0, 3.0), rtol=1e-12
    )
    kept = with_consequences(changed, [*places, ("par", "inner", "lead", 0)], 0.005)
    assert kept.par.inner.lead == law.par.inner.lead


@pytest.mark.parametrize("kind", ["tilts", "servos"])
def test_a_clock_that_does_not_tick_is_refused_under_two_layers(kind):
    with pytest.raises(
        skyarm.ScenarioError,
        match=r"controller\.reference_period = 0\.5: must be 0\.02 s",
    ):
        check_scenario(planned(layered(kind, reference_period=0.5)))


def test_gains_for_other_joints_are_refused_under_two_layers():
    law = layered("tilts")
    own = innermost(law.par)
    short = dataclasses.replace(
        own.joint_gains, stiffness=own.joint_gains.stiffness[:1]
    )
    par = with_innermost(law.par, dataclasses.replace(own, joint_gains=short))
    with pytest.raises(
        skyarm.ScenarioError, match=r"joint_gains\.stiffness: 1 values, must be 2"
    ):
        check_scenario(planned(dataclasses.replace(law, par=par)))


@pytest.mark.parametrize(("kind", "depth"), [("tilts", 1), ("tilts and servos", 2)])
def test_gains_of_the_recovery_have_their_units_in_c(kind, depth):
    law = layered(kind)
    par = law.par
    for _ in range(depth):
        par = par.inner
    assert par.recovery is not None
    assert ("parameters", *("inner",) * depth, "recovery", "joint_gains") in _on_torque(
        law
    )
