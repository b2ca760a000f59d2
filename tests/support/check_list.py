"""List of the checks of ``skyarm check``: question, possible levels, quantity, limits
and usual remedy of each.

A question of a finding equals one of the list, apart from names of joints and words
about a load.
"""

from __future__ import annotations

from typing import NamedTuple

from skyarm.studies.assess.along_reference import BLOW, CLEARANCES
from skyarm.studies.assess.assessment import LAW, MESHES, PARTS, PLAN, QUESTION, REFUSED
from skyarm.studies.assess.endurance import SHORTEST
from skyarm.studies.assess.finding import UNITS
from skyarm.studies.assess.joints import OFTEN, OWN
from skyarm.studies.assess.layout import (
    DISC_LOADING,
    MOMENT_ARMS,
    THRUST_COEFFICIENTS,
    UNEVEN,
)
from skyarm.studies.assess.pressing_flights import ALLOWED, LIMITED, NOISES, STEPS
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
from skyarm.studies.stability.hover_delay import ENOUGH as MARGIN

VEHICLE, SCENARIO = "vehicle", "scenario"


class Check(NamedTuple):
    """One check of a vehicle or of a scenario.

    Attributes:
        of: "vehicle" (and of a scenario's vehicle) or "scenario". group: heading of its
            table. question: as in its findings; NAME is a joint.
        levels: levels that it may end as. quantity: what is computed.
        warning, fault: where it is one; empty if it never is.
        remedy: usual remedy.
    """

    of: str
    group: str
    question: str
    levels: str
    quantity: str
    warning: str
    fault: str
    remedy: str


def _authority(name: str, axis: int) -> Check:
    return Check(
        VEHICLE,
        "rotors",
        f"{name} authority",
        "ok, warning, fault",
        "angular acceleration that the rotors can add to hover, worst arm pose",
        f"below {WARNINGS[axis]:g} rad/s^2",
        f"below {FAULTS[axis]:g} rad/s^2",
        "check positions; more thrust margin",
    )


CHECKS: tuple[Check, ...] = (
    Check(
        VEHICLE,
        "file",
        UNITS,
        "ok, warning, fault",
        "whether a number is likely for real vehicles",
        "unlikely, in a scenario",
        "unlikely, in a vehicle",
        "correct the unit",
    ),
    Check(
        VEHICLE,
        "file",
        REFUSED,
        "fault",
        "whether plants can integrate joint friction and stops",
        "",
        "too stiff",
        "lower the damping, or state the armature",
    ),
    Check(
        VEHICLE,
        "rotors",
        "weight on the rotors' discs",
        "ok, fault",
        "weight over the area of the discs",
        "",
        f"outside {DISC_LOADING[0]:g} to {DISC_LOADING[1]:g} N/m^2",
        "check masses (kg) and rotor positions (m)",
    ),
    Check(
        VEHICLE,
        "rotors",
        "rotors",
        "fault",
        "thrust and torque that the rotors can give",
        "",
        "none about some axis",
        "check axes and positions",
    ),
    Check(
        VEHICLE,
        "rotors",
        "rotors as joints",
        "fault",
        "names and places of driven joints without limits",
        "",
        "those of rotors",
        '`[[rotors]] link = "NAME"`; or `[[joints]]` gives a joint of an '
        "arm its limits",
    ),
    Check(
        VEHICLE,
        "rotors",
        "axes of the rotors",
        "fault",
        "direction of the thrust of a rotor that is not reversible",
        "",
        "down",
        "turn the axis round",
    ),
    Check(
        VEHICLE,
        "rotors",
        "thrust coefficient",
        "ok, warning, fault",
        "C_T = thrust / (rho n^2 D^4), D of the largest discs without overlap",
        "outside, as another program's file states it",
        f"outside {THRUST_COEFFICIENTS[0]:g} to {THRUST_COEFFICIENTS[1]:g}",
        "check its unit, N s^2/rad^2",
    ),
    Check(
        VEHICLE,
        "rotors",
        "moment coefficient",
        "ok, warning, fault",
        "drag torque over the product of thrust and disc radius",
        f"below {MOMENT_ARMS[0]:g}; above {MOMENT_ARMS[1]:g}, as another "
        "program's file states it",
        f"above {MOMENT_ARMS[1]:g}",
        "check its unit, m",
    ),
    Check(
        VEHICLE,
        "rotors",
        "senses of rotation",
        "ok, warning, fault",
        "rotors that turn one way more than the other; relative spread of "
        "hover thrusts",
        "2 rotors more",
        f"spread from {UNEVEN:g} that reversing one rotor, or two, evens",
        "turn one rotor round",
    ),
    Check(
        VEHICLE,
        "rotors",
        "thrust margin",
        "ok, note, warning, fault",
        "largest thrust of the busiest rotor over its hover thrust, worst arm pose",
        f"below {ENOUGH:g}",
        "below 1",
        "less mass, a shorter arm, or more thrust",
    ),
    Check(
        VEHICLE,
        "rotors",
        "balance of the rotors",
        "ok, warning, fault",
        "hover thrust of the idlest rotor over the mean, worst arm pose",
        f"below {LEAST_SHARE:g}",
        "below 0, also of a reversible rotor: the shipped laws reverse none",
        "move mass towards the rotors' middle",
    ),
    Check(
        VEHICLE,
        "arm",
        "joints[NAME] static effort",
        "ok, note, fault",
        "largest effort that holds the arm in any pose",
        "",
        "above the limit of the joint",
        "a stronger drive, or a lighter or shorter arm",
    ),
    _authority("roll", 0),
    _authority("pitch", 1),
    _authority("yaw", 2),
    Check(
        VEHICLE,
        "arm",
        "largest payload",
        "ok, note, warning, fault",
        f"largest mass at the tip with a thrust margin of {ENOUGH:g} in every pose",
        "zero",
        "below `--payload`",
        "carry at most this mass, or strengthen the rotor or joint that is named",
    ),
    Check(
        VEHICLE,
        "rotors",
        "side force of torques",
        "warning",
        "unstable zero of the position, where leaning rotors push against "
        "the tilt that they make",
        f"below {SLOWEST_ZERO:g} rad/s",
        "",
        "lean the rotors inward, or a lower bandwidth",
    ),
    Check(
        VEHICLE,
        "rotors",
        "largest side force",
        "ok, note",
        f"largest steady wind force with a thrust margin of {ENOUGH:g}",
        "",
        "",
        "none",
    ),
    Check(
        VEHICLE,
        "arm",
        "workspace",
        "ok",
        "box around all positions of the tip, base axes",
        "",
        "",
        "none",
    ),
    Check(
        VEHICLE,
        "arm",
        OWN,
        "ok, note",
        "least distance of two shapes of `[[collisions]]` in any arm pose, and the"
        " pose; a note where they overlap",
        "",
        "",
        "narrower joint limits",
    ),
    Check(
        VEHICLE,
        "battery",
        "time aloft",
        "ok, note, warning, fault",
        "time of hover on the battery",
        f"below {SHORTEST:g} s",
        "cannot hover",
        "more cells or more charge",
    ),
    Check(
        VEHICLE,
        "file",
        MESHES,
        "note",
        "mesh files that are not there or cannot be drawn; flights need none",
        "",
        "",
        "put the files beside the URDF file, or take their names out of it",
    ),
    Check(
        SCENARIO,
        "reference",
        PLAN,
        "warning",
        "motion of the tip",
        "reaches joint limits or a near singularity, or needs too much thrust or tilt",
        "",
        "another `posture`, or a slower motion",
    ),
    Check(
        SCENARIO,
        "law",
        LAW,
        "warning",
        "joints whose torque the law relies on",
        "one that no drive moves",
        "",
        "a law that leaves passive joints alone",
    ),
    Check(
        SCENARIO,
        "law",
        PARTS,
        "warning",
        "winds, forces and sensors",
        "without effect",
        "",
        "remove the part, or state its numbers",
    ),
    Check(
        SCENARIO,
        "battery",
        "battery over the flight",
        "ok, fault",
        "of a scenario: time of hover, each load counted while it is held",
        "",
        "below the duration",
        "more charge, or less load",
    ),
    Check(
        SCENARIO,
        "reference",
        "reference within joint limits",
        "fault",
        "joint positions of the reference",
        "",
        "beyond a limit of the joint",
        "a smaller motion, or other limits",
    ),
    Check(
        SCENARIO,
        "reference",
        "rotors along the reference",
        "ok, warning, fault",
        "rotor speeds that exact tracking needs",
        "beyond a limit",
        f"beyond it for over {OFTEN:.0%} of the flight",
        "a slower reference, less load, or stronger rotors",
    ),
    Check(
        SCENARIO,
        "reference",
        "joints along the reference",
        "ok, warning, fault",
        "joint efforts that exact tracking needs",
        "beyond a limit",
        f"beyond it for over {OFTEN:.0%} of the flight",
        "a slower reference, less load, or stronger drives",
    ),
    Check(
        SCENARIO,
        "reference",
        "start of the flight",
        "fault",
        "endings that hold at 0 s",
        "",
        "one holds",
        "another reference, whose base is the origin if left out, or initial state",
    ),
    Check(
        SCENARIO,
        "reference",
        "steps of the reference",
        "warning",
        "largest step of the base velocity of the reference, also from the "
        "vehicle's velocity at the start",
        f"above {BLOW:g} m/s, which is as hard as a blow",
        "",
        "a motion that begins at rest, or an initial velocity",
    ),
    Check(
        SCENARIO,
        "reference",
        "joints[NAME] servo's speed",
        "ok, warning, fault",
        "joint rates of the reference",
        "beyond the limit of the servo",
        f"beyond it for over {OFTEN:.0%} of the flight",
        "a slower reference, or a higher limit or voltage",
    ),
    *(
        Check(
            SCENARIO,
            "reference",
            question,
            "ok, warning",
            "smallest distance of the vehicle's bodies, as they are drawn, from"
            f" {what}, along the reference",
            "below 0",
            "",
            "a path farther from it, or another arm pose",
        )
        for question, what in zip(CLEARANCES, ("surfaces", "each other"), strict=True)
    ),
    Check(
        SCENARIO,
        "contact",
        "contact along the reference",
        "warning, fault",
        "largest force on the tip that a plan counts on in a world without surfaces",
        "above 0",
        "above the weight",
        "what the tip touches in the plan",
    ),
    Check(
        SCENARIO,
        "teams",
        "load share",
        "note",
        "weight of the bodies that the vehicle's grasps carry at the start;"
        " thrust and joint efforts that this takes",
        "",
        "",
        "none",
    ),
    Check(
        SCENARIO,
        "teams",
        "balance of BODY",
        "ok, note, warning",
        "static equilibrium of a body in its grasps at the start",
        "it tips, swings or falls",
        "",
        "grasps around the vertical through its centre of mass",
    ),
    Check(
        SCENARIO,
        "teams",
        "loss of NAME",
        "note, warning",
        "load share and balance with the grasps of one vehicle open; its "
        "number is the least thrust margin of the others",
        "alarm of another vehicle",
        "",
        "a lighter body, more thrust, or one vehicle more",
    ),
    Check(
        SCENARIO,
        "law",
        QUESTION,
        "ok, note, warning, fault",
        "extra delay at which the loop in linearised hover becomes unstable",
        f"below {MARGIN} times the nominal delay, or one control period",
        "unstable as it is",
        "softer gains, faster motors, or less delay",
    ),
    Check(
        SCENARIO,
        "contact",
        "pressing",
        "warning",
        "contact force that the reference commands",
        "to a law without force control",
        "",
        "the law `centroidal` with `interaction`",
    ),
    Check(
        SCENARIO,
        "contact",
        "joints while pressing",
        "ok, warning, fault",
        "joint efforts that the contact force needs, over their limits",
        f"above {WARNS:g}",
        "above 1",
        "less force, or the tip nearer to the joint's height",
    ),
    Check(
        SCENARIO,
        "contact",
        "yaw while pressing",
        "ok, warning",
        "yaw torque of pushing and sliding over the yaw torque of the rotors",
        f"above {HALF:g}",
        "",
        "less force, or a shorter reach",
    ),
    Check(
        SCENARIO,
        "contact",
        "force of a guard",
        "warning",
        "speed that an object gains if the guard's force pushes it for `hold`",
        "above the speed of the approach",
        "",
        "less force, a shorter hold, or a guard that awaits a distance",
    ),
    Check(
        SCENARIO,
        "contact",
        "force without a sensor",
        "note",
        "error of the estimated force if all joint torques are "
        f"{ASSUMED.torques:.0%} off",
        "",
        "",
        "set `tolerances`, or add a force sensor",
    ),
    Check(
        SCENARIO,
        "contact",
        STEPS,
        "fault",
        "integration steps",
        "",
        "too long for the contact's stiffness and the mass of the tip",
        "a softer material",
    ),
    Check(
        SCENARIO,
        "contact",
        IN_FLIGHT,
        "ok, note, fault",
        f"mean force error in {NOISES} simulated flights",
        "",
        f"above {ALLOWED:.0%}; a flight ends early; a rotor is at its limit "
        f"for over {LIMITED:.0%} of the time",
        "mend the cause that is named: yaw torque, reach or a light tip",
    ),
    Check(
        SCENARIO,
        "law",
        CALM,
        "ok, note, fault",
        "with `--flights`: a slow swing in calm air; always: the scenario "
        "of vehicles that hold one object",
        "",
        "lost",
        "another law or other gains",
    ),
    *(
        Check(
            SCENARIO,
            "law",
            f"largest {kind}",
            "note",
            f"with `--flights`: the most that is survived {words}",
            "",
            "",
            "none",
        )
        for kind, (_, _, words) in KINDS.items()
    ),
)
"""Checks in the order of the report."""
