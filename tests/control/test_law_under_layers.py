"""A law under safety, on rotors that tilt and on servos is looked into as deep as it stands."""

from __future__ import annotations

import dataclasses

import pytest

import skyarm
from law_parts import with_parts
from skyarm.actuation.servo import PositionServo
from skyarm.algebra import Vec3
from skyarm.control.actuator_layer import with_actuators
from skyarm.control.blocks.observed_push import observed_push
from skyarm.control.controller import innermost, with_innermost
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.lag_estimate import lags_found
from skyarm.control.laws.centroidal.parameters import CentroidalParameters
from skyarm.control.model import Model
from skyarm.control.safety import with_safety_layer
from skyarm.onboard.export_c import _on_torque, _structure
from skyarm.plant.interface import Truth
from skyarm.reference import hover
from skyarm.scenario.scenario_record import Scenario
from skyarm.stability.frozen_scenario import without_adaptation
from skyarm.stability.hover_delay import believed_delay, finds_lag, hover_of
from skyarm.vehicle.vehicle_records import MountedDrive

SERVO = PositionServo(stiffness=9.0, damping=0.2, inertia=0.01)
LIMITS = {"stiffness": 8.0, "damping": 4.0}


def layered(kind, **options):
    """A guarded law that adapts, on rotors that tilt or on servos or on both."""
    vehicle = skyarm.load_vehicle("voliro_like")
    options = {"mode": "tip", "preset": "adaptive", "sideways": 0.9 * ("tilts" in kind)} | options
    law = with_safety_layer(make_centroidal(Model(vehicle=vehicle), **options), LIMITS)
    if "servos" not in kind:
        return law
    drives = tuple(MountedDrive(name=link.joint.name, drive=SERVO) for link in vehicle.links)
    return with_actuators(law, Model(vehicle=dataclasses.replace(vehicle, drives=drives)), 0.005)


def planned(law):
    """A hover under a law."""
    vehicle = law.par.model.vehicle
    trajectory = hover((0.0, 0.0, 2.0), joints=(0.0,) * vehicle.n)
    return Scenario(name="hover", duration=0.1, world=Truth(vehicle=vehicle), controller=law, trajectory=trajectory)


@pytest.mark.parametrize("kind", ["tilts", "servos", "tilts and servos"])
def test_the_law_itself_is_found_under_two_layers_and_three(kind):
    law = layered(kind, delay=0.01)
    own = innermost(law.par)
    assert isinstance(own, CentroidalParameters)
    assert with_innermost(law.par, own) == law.par
    assert lags_found(law.memory) == (0.0, 0.0)
    assert observed_push(law.memory) is None
    presses = layered(kind, interaction=(0.3, 0.1)).memory
    pushed = dataclasses.replace(innermost(presses).parts.interaction, force=Vec3(1.0, 2.0, 3.0))
    told = with_innermost(presses, with_parts(innermost(presses), interaction=pushed))
    assert observed_push(told) == Vec3(1.0, 2.0, 3.0)
    assert finds_lag(law)
    flown = planned(law)
    assert believed_delay(flown) == pytest.approx(0.01)
    assert hover_of(law).delays.measurement == pytest.approx(0.01)
    still = innermost(without_adaptation(flown).controller.par)
    assert own.parts.adaptation.load is not None
    assert still.parts.adaptation.load is None
    assert _structure(law)[1:] == own.choices()


@pytest.mark.parametrize("kind", ["tilts", "servos"])
def test_a_clock_that_does_not_tick_is_refused_under_two_layers(kind):
    with pytest.raises(skyarm.ScenarioError, match=r"controller\.reference_period = 0\.5: must be 0\.02 s"):
        planned(layered(kind, reference_period=0.5))


def test_gains_for_other_joints_are_refused_under_two_layers():
    law = layered("tilts")
    own = innermost(law.par)
    short = dataclasses.replace(own.joint_gains, stiffness=own.joint_gains.stiffness[:1])
    par = with_innermost(law.par, dataclasses.replace(own, joint_gains=short))
    with pytest.raises(skyarm.ScenarioError, match=r"joint_gains\.stiffness: 1 values, must be 2"):
        planned(dataclasses.replace(law, par=par))


@pytest.mark.parametrize(("kind", "depth"), [("tilts", 1), ("tilts and servos", 2)])
def test_gains_of_the_recovery_have_their_units_in_c(kind, depth):
    law = layered(kind)
    par = law.par
    for _ in range(depth):
        par = par.inner
    assert par.recovery is not None
    assert ("parameters", *("inner",) * depth, "recovery", "joint_gains") in _on_torque(law)
