"""List of the checks of ``skyarm check``: question, possible levels, limits and usual remedy of each.

A question of a finding equals one of the list, apart from names of joints and words about a load.
"""

from __future__ import annotations

from typing import NamedTuple

from skyarm.studies.assess.assessment import LAW, PARTS, PLAN, QUESTION
from skyarm.studies.assess.endurance import SHORTEST
from skyarm.studies.assess.finding import UNITS
from skyarm.studies.assess.joints import OFTEN
from skyarm.studies.assess.layout import DISC_LOADING, MOMENT_ARMS, THRUST_COEFFICIENTS, UNEVEN
from skyarm.studies.assess.pressing_flights import ALLOWED, STEPS
from skyarm.studies.assess.pressing_flights import QUESTION as IN_FLIGHT
from skyarm.studies.assess.push_limits import ASSUMED, HALF, WARNS
from skyarm.studies.assess.thrust import ENOUGH, FAULTS, LEAST_SHARE, WARNINGS

VEHICLE, SCENARIO = "vehicle", "scenario"


class Check(NamedTuple):
    """One check of a vehicle or of a scenario.

    Attributes:
        of: "vehicle" (and of a scenario's vehicle) or "scenario". question: as in its findings; NAME is a joint.
        levels: levels that it may end as. looks_at: computed quantity and limits. remedy: usual remedy.
    """

    of: str
    question: str
    levels: str
    looks_at: str
    remedy: str


def _authority(name: str, axis: int) -> Check:
    looks_at = (
        "angular acceleration left in hover, worst arm pose; "
        f"fault below {FAULTS[axis]:g} rad/s^2, warning below {WARNINGS[axis]:g}"
    )
    return Check(VEHICLE, f"{name} authority", "ok, warning, fault", looks_at, "check positions; more thrust margin")


CHECKS: tuple[Check, ...] = (
    Check(
        VEHICLE,
        UNITS,
        "ok, warning, fault",
        "sizes of all numbers against those of real vehicles; fault in a vehicle, warning in a scenario",
        "correct the unit",
    ),
    Check(
        VEHICLE,
        "weight on the rotors' discs",
        "ok, fault",
        f"weight over disc area, between {DISC_LOADING[0]:g} and {DISC_LOADING[1]:g} N/m^2",
        "check masses (kg) and rotor positions (m)",
    ),
    Check(
        VEHICLE,
        "rotors",
        "fault",
        "whether the rotors give torque about all axes and thrust",
        "check axes and positions",
    ),
    Check(VEHICLE, "axes of the rotors", "fault", "positive thrust points down", "turn the axis round"),
    Check(
        VEHICLE,
        "thrust coefficient",
        "ok, fault",
        f"C_T on the largest disc that fits, between {THRUST_COEFFICIENTS[0]:g} and {THRUST_COEFFICIENTS[1]:g}",
        "check its unit, N s^2/rad^2",
    ),
    Check(
        VEHICLE,
        "moment coefficient",
        "ok, warning, fault",
        f"drag torque over thrust in disc radii, between {MOMENT_ARMS[0]:g} and {MOMENT_ARMS[1]:g}",
        "check its unit, m",
    ),
    Check(
        VEHICLE,
        "senses of rotation",
        "ok, warning, fault",
        f"spread of the rotors' hover thrusts; from {UNEVEN:g} a rotor may turn the wrong way",
        "turn one rotor round",
    ),
    Check(
        VEHICLE,
        "thrust margin",
        "ok, note, warning, fault",
        f"thrust of the busiest rotor over that of hover, worst arm pose; fault below 1, warning below {ENOUGH:g}",
        "less mass, a shorter arm, more thrust",
    ),
    Check(
        VEHICLE,
        "balance of the rotors",
        "ok, warning, fault",
        f"thrust of the idlest rotor over the mean, worst arm pose; fault below 0, warning below {LEAST_SHARE:g}",
        "move mass towards the rotors' middle",
    ),
    Check(
        VEHICLE,
        "joints[NAME] static effort",
        "ok, note, fault",
        "largest effort that holds the arm, against the limit of the joint",
        "a stronger drive, a lighter or shorter arm",
    ),
    _authority("roll", 0),
    _authority("pitch", 1),
    _authority("yaw", 2),
    Check(
        VEHICLE,
        "largest payload",
        "ok, note, warning, fault",
        f"mass at the tip with a thrust margin of {ENOUGH:g} in every arm pose",
        "at most this mass, or more of the part that is named",
    ),
    Check(
        VEHICLE, "largest side force", "ok, note", f"steady wind in hover with a thrust margin of {ENOUGH:g}", "none"
    ),
    Check(VEHICLE, "workspace", "ok", "box of the tip's places in base axes", "none"),
    Check(
        VEHICLE,
        "time aloft",
        "ok, note, warning, fault",
        f"hover on the battery; warning below {SHORTEST:g} s",
        "more cells or charge",
    ),
    Check(
        SCENARIO, PLAN, "warning", "limits of the vehicle that the tip's motion exceeds", "a slower or smaller motion"
    ),
    Check(SCENARIO, LAW, "warning", "joints without a drive under a law that needs their torques", "another law"),
    Check(
        SCENARIO, PARTS, "warning", "wind, forces and sensors without effect", "remove the part, or state its numbers"
    ),
    Check(SCENARIO, "battery over the flight", "ok, fault", "hover on the battery against the duration", "more charge"),
    Check(
        SCENARIO,
        "reference within joint limits",
        "fault",
        "joint reference against the limits",
        "a smaller motion, or other limits",
    ),
    Check(
        SCENARIO,
        "rotors along the reference",
        "ok, warning, fault",
        f"rotor speeds of exact tracking against their limits; fault beyond {OFTEN:.0%} of the flight",
        "a slower reference, less load, stronger rotors",
    ),
    Check(
        SCENARIO,
        "joints along the reference",
        "ok, warning, fault",
        f"joint efforts of exact tracking against their limits; fault beyond {OFTEN:.0%} of the flight",
        "a slower reference, less load, stronger drives",
    ),
    Check(
        SCENARIO,
        "joints[NAME] servo's speed",
        "ok, warning, fault",
        f"joint rate against the servo's; fault beyond {OFTEN:.0%} of the flight",
        "a slower reference, a higher limit or voltage",
    ),
    Check(
        SCENARIO,
        QUESTION,
        "ok, note, warning",
        "extra delay in hover until instability",
        "softer gains, faster motors, less delay",
    ),
    Check(
        SCENARIO,
        "pressing",
        "warning",
        "contact force for a law that follows positions alone",
        "the law `centroidal` with `interaction`",
    ),
    Check(
        SCENARIO,
        "joints while pressing",
        "ok, warning, fault",
        f"joint efforts of the contact force over their limits; warning above {WARNS:g}, fault above 1",
        "less force, or the tip nearer to the joint's height",
    ),
    Check(
        SCENARIO,
        "yaw while pressing",
        "ok, warning",
        f"yaw torque of pushing and sliding over that of the rotors; warning above {HALF:g}",
        "less force, a shorter reach",
    ),
    Check(
        SCENARIO,
        "force of a guard",
        "warning",
        "object that a guard's force moves faster than the contact can follow",
        "less force, a shorter hold, a distance in its place",
    ),
    Check(
        SCENARIO,
        "force without a sensor",
        "note",
        f"error of the estimated force if all joint torques are {ASSUMED.torques:.0%} off",
        "`tolerances`, or a force sensor",
    ),
    Check(SCENARIO, STEPS, "fault", "integration steps of the contact for the mass of the tip", "softer material"),
    Check(
        SCENARIO,
        IN_FLIGHT,
        "ok, note, fault",
        f"mean force error in simulated flights; fault above {ALLOWED:.0%}",
        "the likeliest cause is named: yaw torque, reach or a light tip",
    ),
)
"""Checks in the order of the report."""
