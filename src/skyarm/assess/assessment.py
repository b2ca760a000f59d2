"""All questions about a vehicle or a scenario, asked and answered."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from typing import Any

from skyarm.actuation import AllocationError, make_mixer
from skyarm.assess.along_reference import along_reference
from skyarm.assess.arm_poses import POSES, ArmPoses, arm_poses
from skyarm.assess.arm_workspace import arm_workspace
from skyarm.assess.delay_margin import delay_margin
from skyarm.assess.endurance import aloft_for, time_aloft
from skyarm.assess.finding import FAULT, WARNING, Finding, worst_level
from skyarm.assess.joint_torques import joint_torques
from skyarm.assess.lag_margin import motor_lag
from skyarm.assess.largest_payload import largest_payload
from skyarm.assess.largest_wind import largest_wind
from skyarm.assess.level_hover import Allocation
from skyarm.assess.likely_units import units_of_vehicle, warnings_of_scenario
from skyarm.assess.mass_balance import center_of_mass_shift, mass_and_inertia
from skyarm.assess.mujoco_certificate import certificate
from skyarm.assess.push_limits import push_limits
from skyarm.assess.rotor_layout import rotor_layout
from skyarm.assess.servo_stiffness import servo_stiffness
from skyarm.assess.sideways_reach import sideways_reach
from skyarm.assess.thrust_margin import thrust_margin
from skyarm.assess.torque_authority import torque_authority
from skyarm.files import number
from skyarm.scenario.scenario_record import Scenario
from skyarm.vehicle.vehicle_records import Vehicle


@dataclass(frozen=True, slots=True)
class Assessment:
    """What was found about a vehicle, or about a scenario and the vehicle that flies it.

    Attributes:
        name: of what was asked about. vehicle: the one that flies. gravity: m/s^2. payload: kg at the tip.
        poses: how many arm poses were sampled. seed: of them. findings: in the order of the questions.
    """

    name: str
    vehicle: Vehicle
    gravity: float
    payload: float
    poses: int
    seed: int
    findings: tuple[Finding, ...]

    @property
    def flies(self) -> bool:
        """Whether no fault was found."""
        return worst_level(self.findings) != FAULT

    def alarms(self) -> list[Finding]:
        """Faults, then warnings."""
        return [each for level in (FAULT, WARNING) for each in self.findings if each.level == level]

    def plain(self) -> dict[str, Any]:
        """The assessment as plain data."""
        return {
            "name": self.name,
            "vehicle": self.vehicle.name,
            "can_fly": self.flies,
            "gravity_m_s2": self.gravity,
            "payload_kg": self.payload,
            "arm_poses": self.poses,
            "seed": self.seed,
            "findings": [each.plain() for each in self.findings],
        }


def assess_vehicle(
    vehicle: Vehicle, *, gravity: float = 9.81, payload: float = 0.0, poses: int = POSES, seed: int = 0
) -> Assessment:
    """Ask everything about a vehicle.

    Args:
        vehicle: with concrete numbers.
        gravity: m/s^2.
        payload: kg, a point mass at the tip.
        poses: sampled arm poses.
        seed: of the poses, the local search and the certificate's states.

    Raises:
        ValueError: one line: an argument outside of what is allowed.
    """
    number(gravity, "--gravity", low=0.0, strict=True)
    number(payload, "--payload", low=0.0)
    if payload and not vehicle.end_effector:
        raise ValueError(
            f"--payload = {payload:g}: must be left out: vehicle '{vehicle.name}' has no tip (end_effector)"
        )
    sampled = arm_poses(vehicle, poses, seed)
    findings = (*_of_vehicle(vehicle, gravity, payload, sampled), *certificate(vehicle, gravity, seed))
    return Assessment(vehicle.name, vehicle, gravity, payload, poses, seed, findings)


def assess_scenario(scenario: Scenario, *, payload: float = 0.0, poses: int = POSES, seed: int = 0) -> Assessment:
    """Ask everything about the vehicle of a scenario's plant, and the reference against its limits.

    Raises:
        ValueError: as :func:`assess_vehicle`.
    """
    about = assess_vehicle(
        scenario.world.vehicle, gravity=float(scenario.world.gravity), payload=payload, poses=poses, seed=seed
    )
    try:
        along = [*along_reference(scenario), *push_limits(scenario)]
    except AllocationError:  # said by the vehicle's own findings
        along = []
    aloft = aloft_for(about.vehicle, about.gravity, scenario.duration)
    findings = (*about.findings, *warnings_of_scenario(scenario), *aloft, *along)
    if worst_level(findings) != FAULT:  # what cannot fly has no loop to ask about
        findings = (*findings, *delay_margin(scenario))
    return Assessment(scenario.name, about.vehicle, about.gravity, payload, poses, seed, findings)


def _of_vehicle(vehicle: Vehicle, gravity: float, payload: float, poses: ArmPoses) -> list[Finding]:
    """Every question about a vehicle; those about rotors only where it has some."""
    found = [*units_of_vehicle(vehicle), *mass_and_inertia(vehicle, gravity)]
    allocation = None
    if vehicle.rotors:
        found += rotor_layout(vehicle, gravity)
        with contextlib.suppress(AllocationError):  # said by rotor_layout
            allocation = Allocation.of(make_mixer(vehicle))
    else:
        text = "no rotors: nothing holds it up"
        found.append(Finding(question="rotors", level=FAULT, text=text, field="rotors", remedy="add [[rotors]]"))
    loads = [(vehicle, "")]
    if payload:
        loads.append((vehicle.with_payload(payload), f" with {payload:g} kg"))
    for held, words in loads:
        hanging = poses.of(held)
        if allocation is not None:
            found += thrust_margin(held, allocation, hanging, gravity, words)
        found += center_of_mass_shift(held, hanging, gravity, words)
        found += joint_torques(held, hanging, gravity, words)
    if allocation is not None:
        found += torque_authority(loads[-1][0], allocation, poses.of(loads[-1][0]), gravity)
        found += sideways_reach(loads[-1][0], poses.of(loads[-1][0]), gravity)
        found += largest_payload(vehicle, allocation, poses, gravity, payload)
        found += largest_wind(vehicle, gravity, payload)
    endurance = [each for held, words in loads for each in time_aloft(held, gravity, words)]
    return [*found, *arm_workspace(vehicle, poses), *motor_lag(vehicle), *servo_stiffness(vehicle), *endurance]
