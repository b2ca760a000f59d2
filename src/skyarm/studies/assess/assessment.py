"""Feasibility assessment of a vehicle or a scenario: all checks and their findings."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import field, replace
from functools import cache, partial

from skyarm.dynamics.actuators import AllocationError, make_mixer
from skyarm.plant.interface import require_gravity
from skyarm.plant.joint_rate import joint_rate
from skyarm.records.field_rules import rules
from skyarm.records.files import PathLike, number
from skyarm.records.immutable import positional
from skyarm.records.notebook import notebook_html
from skyarm.records.registry.shipped import SHIPPED
from skyarm.scenario.scenario_file import is_scenario, load_scenario
from skyarm.scenario.scenario_record import Scenario, with_words
from skyarm.scenario.unlikely_numbers import (
    law_warnings,
    part_warnings,
    plan_warnings,
    unlikely_in_vehicle,
    unlikely_units,
)
from skyarm.scenario.without_effect import WithoutEffectWarning
from skyarm.simulate.examine import require_shapes
from skyarm.studies.assess.along_reference import along_reference, met_at_start
from skyarm.studies.assess.arm_poses import POSES, ArmPoses, arm_poses
from skyarm.studies.assess.causes import causes_first
from skyarm.studies.assess.endurance import aloft_for, time_aloft
from skyarm.studies.assess.finding import (
    FAULT,
    NOTE,
    OK,
    UNITS,
    WARNING,
    Finding,
    finding_of_line,
    worst_level,
)
from skyarm.studies.assess.flight_loads import flight_parts
from skyarm.studies.assess.joints import arm_workspace, joint_torques, own_collision
from skyarm.studies.assess.layout import (
    disc_loading,
    links_like_rotors,
    rotor_layout,
    rotors_as_joints,
)
from skyarm.studies.assess.load_sharing import (
    balance_of_bodies,
    balances,
    carried_loads,
    load_of,
    losses,
)
from skyarm.studies.assess.pressing_flights import pressing_flights
from skyarm.studies.assess.push_limits import push_limits
from skyarm.studies.assess.survival_limits import QUESTION as CALM
from skyarm.studies.assess.survival_limits import flight_together, survival_limits
from skyarm.studies.assess.thrust import (
    OWN_LAW,
    largest_payload,
    largest_side_force,
    side_forces,
    thrust_margin,
    torque_authority,
)
from skyarm.studies.stability.hover_delay import hover_delay_if_known, hover_digest
from skyarm.vehicle import Vehicle, VehicleError
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.view.pages import Facts
from skyarm.world.payload import Payload

QUESTION, REFUSED = "delay margin", "simulation"


def delay_margin(scenario: Scenario) -> list[Finding]:
    """Check result for the delay margin in hover: tolerable delay beyond the nominal
    delay of the loop.
    """
    delay = hover_delay_if_known(scenario)
    if isinstance(delay, str):
        return [Finding(QUESTION, NOTE, f"not known: {delay}")]
    text = delay.sentence(scenario.agent.controller.name)
    unit = "s"
    if not delay.margin > 0.0:
        remedy = (
            "softer gains or another law: skyarm margins shows which loop is short of"
            " margin"
        )
        return [Finding(QUESTION, FAULT, text, "controller", remedy, 0.0, 0.0, unit)]
    # a dash in the tables: no delay makes the loop unstable
    margin = delay.margin if math.isfinite(delay.margin) else math.nan
    least = delay.least_margin
    if delay.enough:
        return [Finding(QUESTION, OK, text, value=margin, limit=least, unit=unit)]
    remedy = (
        f"{delay.shortfall}: softer gains, faster motors or a shorter delay; "
        "skyarm margins shows which loop is short of it"
    )
    return [Finding(QUESTION, WARNING, text, "controller", remedy, margin, least, unit)]


PLAN, LAW, PARTS = "plan of the reference", "law for this vehicle", "environment"
"""Names of the questions about plan, law and parts."""


def units_of_vehicle(vehicle: Vehicle) -> list[Finding]:
    """Check results, as faults, for vehicle parameters that are probably in wrong
    units.
    """
    faults = [
        finding_of_line(line, UNITS, FAULT) for line in unlikely_in_vehicle(vehicle)
    ]
    return faults or [
        Finding(UNITS, OK, "every number of the vehicle is of a likely size")
    ]


def warnings_of_scenario(scenario: Scenario) -> list[Finding]:
    """Warnings of a scenario's check: suspicious values, reference beyond limits,
    unsuitable control law.
    """
    units = [finding_of_line(line, UNITS, WARNING) for line in unlikely_units(scenario)]
    good = Finding(UNITS, OK, "every number of the scenario is of a likely size")
    return [
        *(units or [good]),
        *(finding_of_line(line, PLAN, WARNING) for line in plan_warnings(scenario)),
        *(finding_of_line(line, LAW, WARNING) for line in law_warnings(scenario)),
        *(finding_of_line(line, PARTS, WARNING) for line in part_warnings(scenario)),
    ]


@positional
class Assessment:
    """Results of all feasibility checks of a vehicle or of a scenario.

    Attributes:
        name: name of the vehicle or scenario. vehicle: the simulated one, the first of
            several.
        gravity: m/s^2. payload: kg at the tip. poses: number of sampled arm poses.
        findings: results in the order of the questions; of several vehicles those about
            all.
        agents: results for each of several vehicles by name; empty for one.
    """

    name: str
    vehicle: Vehicle
    gravity: float
    payload: float
    poses: int
    findings: tuple[Finding, ...]
    agents: Mapping[str, Assessment] = field(default_factory=dict)

    def _repr_html_(self) -> str:
        return notebook_html(self)

    @property
    def flies(self) -> bool:
        """True if no check found a fault, so that the vehicle can fly."""
        return worst_level(self.every) != FAULT

    @property
    def every(self) -> list[Finding]:
        """All results: those of each of several vehicles, then those about all."""
        return [
            *(each for one in self.agents.values() for each in one.findings),
            *self.findings,
        ]

    def alarms(self) -> list[Finding]:
        """Check results that are faults, then those that are warnings."""
        every = self.every
        faults = [each for each in every if each.level == FAULT]
        return faults + [each for each in every if each.level == WARNING]

    def plain(self) -> Facts:
        """Results of a feasibility check as plain data, for a JSON file."""
        return {
            "name": self.name,
            **({} if self.agents else {"vehicle": self.vehicle.name}),
            "can_fly": self.flies,
            "gravity_m_s2": self.gravity,
            "payload_kg": self.payload,
            "arm_poses": self.poses,
            **(
                {"agents": {name: each.plain() for name, each in self.agents.items()}}
                if self.agents
                else {}
            ),
            "findings": [each.plain() for each in self.findings],
        }


def check(
    what: Vehicle | Scenario | PathLike,
    *,
    payload: float = 0.0,
    poses: int = POSES,
    gravity: float | None = None,
    flights: bool = False,
) -> Assessment:
    """Check if a vehicle, or the vehicle of a scenario, can fly, and explain why not,
    as ``skyarm check`` does.

    Args:
        what: a vehicle or a scenario, or the name or path of one.
        payload: kg, a point mass at the tip.
        poses: sampled arm poses.
        gravity: m/s^2, for a vehicle; 9.81 if left out.
        flights: of a scenario also fly blows, late commands and loads, and state the
            largest that are survived.

    Raises:
        ValueError: one line: what cannot be read, or an argument outside of what is
            allowed.
    """
    file = ""
    if not isinstance(what, (Vehicle, Scenario)):
        file = str(what)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", WithoutEffectWarning)  # a finding below
            what = load_scenario(what) if is_scenario(file) else load_vehicle(what)
    # the flights are hovers of one vehicle without its world
    if flights and (isinstance(what, Vehicle) or what.is_team):
        raise ValueError(
            "--flights: must be left out unless a scenario of one vehicle states the"
            " law that flies"
        )
    if isinstance(what, Vehicle):
        gravity = 9.81 if gravity is None else gravity
        return assess_vehicle(
            what, gravity=gravity, payload=payload, poses=poses, file=file
        )
    if gravity is not None:
        raise ValueError(
            f"--gravity = {gravity:g}: must be left out: the scenario states its own"
            " (plant.gravity)"
        )
    require_shapes(what)
    if flights and payload:
        raise ValueError(
            f"--payload = {payload:g}: must be left out beside --flights: state"
            " payloads in the scenario"
        )
    found = assess_scenario(what, payload=payload, poses=poses)
    if not flights:
        return found
    flown = (
        survival_limits(what)
        if found.flies
        else [Finding(CALM, NOTE, "not flown: a fault above")]
    )
    return replace(found, findings=(*found.findings, *flown))


def assess_vehicle(
    vehicle: Vehicle,
    *,
    gravity: float = 9.81,
    payload: float = 0.0,
    poses: int = POSES,
    file: str = "",
) -> Assessment:
    """Run all checks of a vehicle.

    Args:
        vehicle: vehicle with concrete numbers.
        gravity: m/s^2.
        payload: kg, a point mass at the tip.
        poses: sampled arm poses.
        file: file of the vehicle, "" if there is none.

    Raises:
        ValueError: one line: an argument outside of what is allowed.
    """
    number(require_gravity(gravity, "--gravity"), "--gravity", low=0.0, strict=True)
    # the option is held to the rule of a payload in a file
    rules(Payload)["mass"]("--payload", payload)
    if payload and not vehicle.end_effector:
        lacks = f"vehicle '{vehicle.name}' has no tip (end_effector){vehicle.tip_cure}"
        raise ValueError(f"--payload = {payload:g}: must be left out: {lacks}")
    findings = causes_first(
        [*_vehicle_findings(arm_poses(vehicle, poses, gravity), payload, file)]
    )
    return Assessment(vehicle.name, vehicle, gravity, payload, poses, findings)


def assess_scenario(
    scenario: Scenario, *, payload: float = 0.0, poses: int = POSES
) -> Assessment:
    """Run all checks of a scenario: its vehicles, their references against their
    limits, and the bodies that they hold.

    Raises:
        ValueError: as :func:`assess_vehicle`.
    """
    bodies = balances(scenario)
    agents = dict[str, Assessment]()
    margins = dict[str, list[Finding]]()
    # of vehicles that are equal
    once = cache(partial(assess_vehicle, payload=payload, poses=poses))
    for name in scenario.agents:
        one = scenario.of(name)
        plant = one.agent.plant
        about = once(plant.vehicle, gravity=float(plant.gravity))
        try:
            carried = carried_loads(scenario, name, bodies)
            aloft = aloft_for(flight_parts(one, carried), payload)
            along = [
                *met_at_start(one),
                *along_reference(one, clearance=True, carried=carried),
                *push_limits(one),
            ]
            along += load_of(scenario, name, bodies, payload)
        except AllocationError:  # said by the vehicle's own findings
            aloft = along = []
        found = about.findings
        # which may turn rotors backwards
        if one.agent.controller.name not in SHIPPED["law"]:
            found = tuple(
                replace(each, level=WARNING) if each.remedy == OWN_LAW else each
                for each in found
            )
        findings = causes_first([*found, *warnings_of_scenario(one), *aloft, *along])
        if worst_level(findings) != FAULT:  # what cannot fly has no loop to ask about
            # by itself: others are not there, and a body that turns freely in a grasp
            # would count as unstable
            hovering = with_words(one, world=None) if bodies or one.others else one
            # equal vehicles with equal laws have one margin: it is computed once
            alike = hover_digest(hovering)
            if alike not in margins:
                margins[alike] = delay_margin(hovering)
            findings = (*findings, *margins[alike], *pressing_flights(one))
        agents[name] = replace(about, name=name, findings=findings)
    first = next(iter(agents.values()))
    flies = all(each.flies for each in agents.values())
    shared = balance_of_bodies(bodies)
    # where one vehicle holds a body nobody is left to bear the share of a lost one
    if flies and scenario.is_team and bodies:
        shared += [*losses(scenario, bodies, payload), *flight_together(scenario)]
    # one vehicle's report is flat, as its JSON file is; several have one each
    if not scenario.is_team:
        return replace(first, name=scenario.name, findings=(*first.findings, *shared))
    return replace(first, name=scenario.name, findings=tuple(shared), agents=agents)


MESHES = "meshes"
"""Name of the question about files of the vehicle's drawing."""


def _vehicle_findings(poses: ArmPoses, payload: float, file: str) -> list[Finding]:
    """Results of all checks of a vehicle; without rotors a fault replaces those of
    thrust.
    """
    vehicle, gravity = poses.vehicle, poses.gravity
    findings = [
        *units_of_vehicle(vehicle),
        *_refused_by_plant(vehicle),
        *disc_loading(vehicle, gravity),
    ]
    if vehicle.rotors:
        findings += rotor_layout(vehicle, gravity)
    else:
        findings.append(_no_rotors(vehicle, file))
    findings += rotors_as_joints(vehicle)
    loads = [
        poses,
        *(
            [poses.of(vehicle.with_payload(payload), f" with {payload:g} kg")]
            if payload
            else []
        ),
    ]
    turned = bool(vehicle.rotors) and _has_full_allocation(vehicle)
    for loaded in loads:
        if turned:
            findings += thrust_margin(loaded)
        findings += joint_torques(loaded)
    # authority is asked of the loaded vehicle, the largest payload of the bare one
    if turned:
        findings += [*torque_authority(loads[-1]), *side_forces(loads[-1])]
        findings += [
            *largest_payload(poses, payload),
            *largest_side_force(vehicle, gravity, payload),
        ]
    endurance = [
        each
        for loaded in loads
        for each in time_aloft(loaded.vehicle, gravity, loaded.held)
    ]
    arm = [*arm_workspace(poses), *own_collision(poses)]
    # no picture of the vehicle can show them
    meshes = [Finding(MESHES, NOTE, line) for line in vehicle.missing_meshes]
    return [*findings, *arm, *endurance, *meshes]


def _refused_by_plant(vehicle: Vehicle) -> list[Finding]:
    """Fault of a vehicle whose joints are too stiff for every plant, which refuses
    it.
    """
    try:
        joint_rate(vehicle)
    except VehicleError as error:
        return [
            replace(
                finding_of_line(str(error), REFUSED, FAULT),
                remedy=str(error).rpartition("; ")[2],
            )
        ]
    return []


def _no_rotors(vehicle: Vehicle, file: str) -> Finding:
    """Fault of a vehicle without rotors: there are none, or its file states some with
    gaps.
    """
    place = f"{file}, where they are missing"
    writes = ""
    if not file.endswith(".toml"):
        place = "a vehicle file"
        writes = (
            "; of a .urdf, .xml or .sdf file this writes the vehicle file: skyarm new"
            " vehicle NAME --from FILE"
        )
    text = "; ".join(vehicle.gaps)
    remedy = f"state them in {place}{writes}"
    if not vehicle.gaps:
        # one name shows how the line is meant; the others follow from it
        like = "".join(f', link = "{name}"' for name in links_like_rotors(vehicle)[:1])
        text = "no rotors: nothing holds it up"
        remedy = (
            f"add [[rotors]]{like}, or put it as an arm on a multirotor by [[attach]]"
            f" in that one's file{writes}"
        )
    return Finding("rotors", FAULT, text, "rotors", remedy)


def _has_full_allocation(vehicle: Vehicle) -> bool:
    """True if the rotors span all torque axes and thrust; otherwise
    :func:`rotor_layout` reports a fault.
    """
    try:
        make_mixer(vehicle)
    except AllocationError:
        return False
    return True
