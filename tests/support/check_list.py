"""List of the checks of ``skyarm check``: question, possible levels, limits and usual
remedy of each.

A question of a finding equals one of the list, apart from names of joints and words
about a load.
"""

from __future__ import annotations

from typing import NamedTuple

from skyarm.studies.assess.along_reference import BLOW, CLEARANCES
from skyarm.studies.assess.assessment import LAW, MESHES, PARTS, PLAN, QUESTION, REFUSED
from skyarm.studies.assess.endurance import SHORTEST
from skyarm.studies.assess.finding import UNITS
from skyarm.studies.assess.joints import OFTEN
from skyarm.studies.assess.layout import (
    DISC_LOADING,
    MOMENT_ARMS,
    THRUST_COEFFICIENTS,
    UNEVEN,
)
from skyarm.studies.assess.pressing_flights import ALLOWED, STEPS
from skyarm.studies.assess.pressing_flights import QUESTION as IN_FLIGHT
from skyarm.studies.assess.push_limits import ASSUMED, HALF, WARNS
from skyarm.studies.assess.survival_limits import KINDS
from skyarm.studies.assess.survival_limits import QUESTION as CALM
from skyarm.studies.assess.thrust import (
    ENOUGH,
    FAULTS,
    LEAST_SHARE,
    SLOWEST_ZERO,
    WARNINGS,
)

VEHICLE, SCENARIO = "vehicle", "scenario"


class Check(NamedTuple):
    """One check of a vehicle or of a scenario.

    Attributes:
        of: "vehicle" (and of a scenario's vehicle) or "scenario". question: as in its
            findings; NAME is a joint.
        levels: levels that it may end as. looks_at: computed quantity and limits.
            remedy: usual remedy.
    """

    of: str
    question: str
    levels: str
    looks_at: str
    remedy: str


def _authority(name: str, axis: int) -> Check:
    looks_at = (
        "angular acceleration that the rotors can add to hover, worst arm pose; "
        f"fault below {FAULTS[axis]:g} rad/s^2, warning below {WARNINGS[axis]:g}"
    )
    return Check(
        VEHICLE,
        f"{name} authority",
        "ok, warning, fault",
        looks_at,
        "check positions; more thrust margin",
    )


CHECKS: tuple[Check, ...] = (
    Check(
        VEHICLE,
        UNITS,
        "ok, warning, fault",
        "whether a number is unlikely for real vehicles; a fault in a vehicle, a"
        " warning in a scenario",
        "correct the unit",
    ),
    Check(
        VEHICLE,
        REFUSED,
        "fault",
        "whether plants refuse the vehicle: joint friction or stops too stiff for the"
        " integration",
        "lower the damping, or state the armature",
    ),
    Check(
        VEHICLE,
        "weight on the rotors' discs",
        "ok, fault",
        f"weight over the area of the discs; fault outside {DISC_LOADING[0]:g} to"
        f" {DISC_LOADING[1]:g} N/m^2",
        "check masses (kg) and rotor positions (m)",
    ),
    Check(
        VEHICLE,
        "rotors",
        "fault",
        "whether the rotors can give thrust and torque about all axes",
        "check axes and positions",
    ),
    Check(
        VEHICLE,
        "rotors as joints",
        "fault",
        "whether driven joints without limits have the names or the places of rotors",
        '`[[rotors]] link = "NAME"`; or `[[joints]]` gives a joint of an arm its'
        " limits",
    ),
    Check(
        VEHICLE,
        "axes of the rotors",
        "fault",
        "whether the thrust of a rotor that is not reversible points down",
        "turn the axis round",
    ),
    Check(
        VEHICLE,
        "thrust coefficient",
        "ok, warning, fault",
        "C_T = thrust / (rho n^2 D^4), D of the largest discs without overlap; "
        f"fault outside {THRUST_COEFFICIENTS[0]:g} to {THRUST_COEFFICIENTS[1]:g}, "
        "or a warning if another program's file states it",
        "check its unit, N s^2/rad^2",
    ),
    Check(
        VEHICLE,
        "moment coefficient",
        "ok, warning, fault",
        "drag torque over the product of thrust and disc radius; fault above"
        f" {MOMENT_ARMS[1]:g}, warning below {MOMENT_ARMS[0]:g}, or where another"
        " program's file states it",
        "check its unit, m",
    ),
    Check(
        VEHICLE,
        "senses of rotation",
        "ok, warning, fault",
        f"relative spread of hover thrusts; fault from {UNEVEN:g} if reversing one"
        " rotor, or two, evens them, warning if senses differ by 2 rotors",
        "turn one rotor round",
    ),
    Check(
        VEHICLE,
        "thrust margin",
        "ok, note, warning, fault",
        "largest thrust of the busiest rotor over its hover thrust, worst arm pose; "
        f"fault below 1, warning below {ENOUGH:g}",
        "less mass, a shorter arm, or more thrust",
    ),
    Check(
        VEHICLE,
        "balance of the rotors",
        "ok, warning, fault",
        "hover thrust of the idlest rotor over the mean, worst arm pose; fault below"
        " 0, also of a reversible rotor, for the shipped laws reverse none; warning"
        f" below {LEAST_SHARE:g}",
        "move mass towards the rotors' middle",
    ),
    Check(
        VEHICLE,
        "joints[NAME] static effort",
        "ok, note, fault",
        "largest effort that holds the arm in any pose; fault above the limit of the"
        " joint",
        "a stronger drive, or a lighter or shorter arm",
    ),
    _authority("roll", 0),
    _authority("pitch", 1),
    _authority("yaw", 2),
    Check(
        VEHICLE,
        "largest payload",
        "ok, note, warning, fault",
        f"largest mass at the tip with a thrust margin of {ENOUGH:g} in every pose; "
        "warning if it is zero, fault if `--payload` is more",
        "carry at most this mass, or strengthen the rotor or joint that is named",
    ),
    Check(
        VEHICLE,
        "side force of torques",
        "warning",
        "unstable zero of the position, where leaning rotors push against the tilt"
        f" that they make; warning below {SLOWEST_ZERO:g} rad/s",
        "lean the rotors inward, or a lower bandwidth",
    ),
    Check(
        VEHICLE,
        "largest side force",
        "ok, note",
        f"largest steady wind force with a thrust margin of {ENOUGH:g}",
        "none",
    ),
    Check(
        VEHICLE,
        "workspace",
        "ok",
        "box around all positions of the tip, base axes",
        "none",
    ),
    Check(
        VEHICLE,
        "time aloft",
        "ok, note, warning, fault",
        f"time of hover on the battery; warning below {SHORTEST:g} s, fault if it"
        " cannot hover",
        "more cells or more charge",
    ),
    Check(
        VEHICLE,
        MESHES,
        "note",
        "mesh files that are not there or cannot be drawn; flights need none",
        "put the files beside the URDF file, or take their names out of it",
    ),
    Check(
        SCENARIO,
        PLAN,
        "warning",
        "whether the motion of the tip reaches joint limits or a near singularity, or"
        " needs too much thrust or tilt",
        "another `posture`, or a slower motion",
    ),
    Check(
        SCENARIO,
        LAW,
        "warning",
        "whether the law relies on the torque of a joint that no drive moves",
        "a law that leaves passive joints alone",
    ),
    Check(
        SCENARIO,
        PARTS,
        "warning",
        "winds, forces and sensors that have no effect",
        "remove the part, or state its numbers",
    ),
    Check(
        SCENARIO,
        "battery over the flight",
        "ok, fault",
        "time of hover on the battery, each load counted while it is held; fault below"
        " the duration",
        "more charge, or less load",
    ),
    Check(
        SCENARIO,
        "reference within joint limits",
        "fault",
        "joint positions of the reference; fault beyond a limit of the joint",
        "a smaller motion, or other limits",
    ),
    Check(
        SCENARIO,
        "rotors along the reference",
        "ok, warning, fault",
        "rotor speeds that exact tracking needs; warning beyond a limit, "
        f"fault beyond it for over {OFTEN:.0%} of the flight",
        "a slower reference, less load, or stronger rotors",
    ),
    Check(
        SCENARIO,
        "joints along the reference",
        "ok, warning, fault",
        "joint efforts that exact tracking needs; warning beyond a limit, "
        f"fault beyond it for over {OFTEN:.0%} of the flight",
        "a slower reference, less load, or stronger drives",
    ),
    Check(
        SCENARIO,
        "steps of the reference",
        "warning",
        "largest step of the base velocity of the reference, also from the vehicle's"
        f" velocity at the start; warning above {BLOW:g} m/s, which is as hard as a"
        " blow",
        "a motion that begins at rest, or an initial velocity",
    ),
    Check(
        SCENARIO,
        "joints[NAME] servo's speed",
        "ok, warning, fault",
        "joint rates of the reference; warning beyond the limit of the servo, "
        f"fault beyond it for over {OFTEN:.0%} of the flight",
        "a slower reference, or a higher limit or voltage",
    ),
    *(
        Check(
            SCENARIO,
            question,
            "ok, warning",
            "smallest distance of the vehicle's bodies, as they are drawn, from"
            f" {what}, along the reference; warning below 0",
            "a path farther from it, or another arm pose",
        )
        for question, what in zip(CLEARANCES, ("surfaces", "each other"), strict=True)
    ),
    Check(
        SCENARIO,
        "contact along the reference",
        "warning, fault",
        "largest force on the tip that a plan counts on in a world without surfaces;"
        " fault above the weight",
        "what the tip touches in the plan",
    ),
    Check(
        SCENARIO,
        "load share",
        "note",
        "weight of the bodies that the vehicle's grasps carry at the start; thrust and"
        " joint efforts that this takes",
        "none",
    ),
    Check(
        SCENARIO,
        "balance of BODY",
        "ok, note, warning",
        "static equilibrium of a body in its grasps at the start; warning if it tips,"
        " swings or falls",
        "grasps around the vertical through its centre of mass",
    ),
    Check(
        SCENARIO,
        "loss of NAME",
        "note, warning",
        "load share and balance with the grasps of one vehicle open; its number is the"
        " least thrust margin of the others; warning at an alarm of another vehicle",
        "a lighter body, more thrust, or one vehicle more",
    ),
    Check(
        SCENARIO,
        QUESTION,
        "ok, note, warning, fault",
        "extra delay at which the loop in hover becomes unstable; fault if it is"
        " unstable as it is",
        "softer gains, faster motors, or less delay",
    ),
    Check(
        SCENARIO,
        "pressing",
        "warning",
        "whether the reference commands a contact force to a law without force control",
        "the law `centroidal` with `interaction`",
    ),
    Check(
        SCENARIO,
        "joints while pressing",
        "ok, warning, fault",
        "joint efforts that the contact force needs, over their limits; warning above"
        f" {WARNS:g}, fault above 1",
        "less force, or the tip nearer to the joint's height",
    ),
    Check(
        SCENARIO,
        "yaw while pressing",
        "ok, warning",
        "yaw torque of pushing and sliding over the yaw torque of the rotors; warning"
        f" above {HALF:g}",
        "less force, or a shorter reach",
    ),
    Check(
        SCENARIO,
        "force of a guard",
        "warning",
        "speed that an object gains if the guard's force pushes it for `hold`; warning"
        " above the speed of the approach",
        "less force, a shorter hold, or a guard that awaits a distance",
    ),
    Check(
        SCENARIO,
        "force without a sensor",
        "note",
        "error of the estimated force if all joint torques are"
        f" {ASSUMED.torques:.0%} off",
        "set `tolerances`, or add a force sensor",
    ),
    Check(
        SCENARIO,
        STEPS,
        "fault",
        "whether the integration steps are too long for the contact's stiffness and the"
        " mass of the tip",
        "a softer material",
    ),
    Check(
        SCENARIO,
        IN_FLIGHT,
        "ok, note, fault",
        f"mean force error in simulated flights; fault above {ALLOWED:.0%}, or if a"
        " flight ends early",
        "mend the cause that is named: yaw torque, reach or a light tip",
    ),
    Check(
        SCENARIO,
        CALM,
        "ok, note, fault",
        "with `--flights`: whether the law flies a slow swing in calm air; "
        "always: whether vehicles that hold one object fly their scenario",
        "another law or other gains",
    ),
    *(
        Check(
            SCENARIO,
            f"largest {kind}",
            "note",
            f"with `--flights`: the most that is survived {words}",
            "none",
        )
        for kind, (_, _, words) in KINDS.items()
    ),
)
"""Checks in the order of the report."""
