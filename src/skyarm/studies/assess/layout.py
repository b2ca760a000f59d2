"""Mass and rotor layout checks: disc loading, senses of rotation, thrust and moment
coefficients, links like rotors.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from skyarm.dynamics.actuators import AllocationError, make_mixer
from skyarm.records.arrays import Array, float_array
from skyarm.studies.assess.arm_poses import Allocation, hover_efforts
from skyarm.studies.assess.finding import FAULT, OK, WARNING, Concern, Finding
from skyarm.vehicle import BASE, Rotor, Vehicle
from skyarm.vehicle.vehicle_records import undriven_joints

DISC_LOADING = 2.0, 1000.0
"""Plausible disc loading (N/m^2): indoor models have 5, multirotors 20 to 200,
helicopters up to 500."""


def disc_loading(vehicle: Vehicle, gravity: float) -> list[Finding]:
    """Check result for the disc loading (weight over rotor disc area) against the range
    of real multirotors.
    """
    if not vehicle.rotors:
        return []
    radius = disc_radius(vehicle)
    loading = (
        float(vehicle.mass) * gravity / (len(vehicle.rotors) * math.pi * radius**2)
    )
    least, most = DISC_LOADING
    level = OK if least <= loading <= most else FAULT
    # of a vehicle that is too heavy the heaviest body is suspect, else the base
    bodies = {"base.mass": vehicle.base} | {
        f"links[{k.name}].mass": k.body for k in vehicle.links
    }
    field = (
        max(bodies, key=lambda name: float(bodies[name].mass))
        if loading > least
        else "base.mass"
    )
    text = (
        f"{loading:.3g} N/m^2 on discs of about {2e3 * radius:.3g} mm"
        f" ({float(bodies[field].mass):g} kg in {field})"
    )
    remedy = f"check {field} (kg, not g?) and rotors.position (m, not mm?)"
    limit = most if loading > least else least
    part = Concern.BASE_LOADING if field == "base.mass" else Concern.ARM_LOADING
    return [
        Finding(
            "weight on the rotors' discs",
            level,
            text,
            field,
            remedy,
            loading,
            limit,
            "N/m^2",
            concerns=part,
        )
    ]


STAGGERED = 0.1
"""Height between two hubs over their distance from which their discs may overlap."""


def disc_radius(vehicle: Vehicle) -> float:
    """Radius (m) of the largest rotor discs that do not overlap; rotors above each
    other are not compared.
    """
    least = float(_hub_distances(vehicle).min(initial=np.inf))
    # a rotor by itself has no neighbour that bounds its disc: 0.1 m, chosen
    return 0.5 * least if least < np.inf else 0.1


def _hub_distances(vehicle: Vehicle) -> Array:
    """Horizontal distances (rotors, rotors) between rotor hubs, m; infinite for coaxial
    or staggered pairs.
    """
    hubs = np.array([float_array(rotor.position) for rotor in vehicle.rotors])
    apart = np.linalg.norm(hubs[:, None, :2] - hubs[None, :, :2], axis=2)
    most = float(apart.max(initial=0.0))
    # hubs closer than a twentieth of the largest distance are coaxial
    beside = np.where((apart > 0.05 * most) & (apart > 0.0), apart, np.inf)
    level = np.where(
        np.abs(hubs[:, None, 2] - hubs[None, :, 2]) <= STAGGERED * apart, beside, np.inf
    )
    # where every pair is staggered heights are no reason to compare none
    return level if np.isfinite(level).any() else beside


AIR = 1.225
"""Air density (kg/m^3), ISA at sea level."""

THRUST_COEFFICIENTS = 0.003, 2.0
"""Plausible thrust coefficient C_T = thrust / (rho n^2 D^4) on the largest disc that
fits. Isolated propellers have 0.05 to 0.15, and discs smaller than those that fit
less."""

MOMENT_ARMS = 0.01, 0.6
"""Plausible drag torque over thrust, in disc radii; propellers have 0.1 to 0.3."""

UNEVEN = 0.2
"""Relative spread of the rotors' hover thrusts above which a flipped rotor is
suspected."""

EVENER = 0.25
"""Fraction of the spread that may remain after one rotor is turned round, if that
explains it."""


def rotor_layout(vehicle: Vehicle, gravity: float) -> list[Finding]:
    """Check results for allocation rank, senses of rotation, and thrust and moment
    coefficients of the rotors.
    """
    findings = [*_axes(vehicle), *_coefficients(vehicle)]
    try:
        make_mixer(vehicle)
    except AllocationError as error:
        remedy = (
            "rotors must give torque about x, y, z and thrust: check positions, axes,"
            " directions"
        )
        # without the field that the message begins with
        text = str(error).partition(": ")[2]
        findings.append(Finding("rotors", FAULT, text, "rotors", remedy))
    findings.append(senses_of_rotation(vehicle, gravity))
    return findings


def _axes(vehicle: Vehicle) -> list[Finding]:
    """Faults for rotors that turn one way and whose thrust points down."""
    findings = []
    for rotor in vehicle.rotors:
        up = float(rotor.axis.z)
        name = f"rotors[{rotor.name}].axis"
        if up < 0.0 and not rotor.reversible:
            text = f"the thrust of {rotor.name} points down (z of its axis: {up:.3g})"
            remedy = (
                f"turn {name} round: it is that of positive thrust; or reversible ="
                " true if it turns both ways, and a law of your own: the shipped ones"
                " turn no rotor backwards"
            )
            findings.append(
                Finding(
                    "axes of the rotors",
                    FAULT,
                    text,
                    name,
                    remedy,
                    up,
                    0.0,
                    concerns=Concern.AXES,
                )
            )
    return findings


def _coefficients(vehicle: Vehicle) -> list[Finding]:
    """Check results for thrust and moment coefficients, by the rotor furthest from the
    plausible range.
    """
    radius = disc_radius(vehicle)
    findings = []
    thrusts = [thrust_number(rotor, radius) for rotor in vehicle.rotors]
    arms = [float(rotor.moment_coefficient) / radius for rotor in vehicle.rotors]
    for field, values, (least, most), what, unit in (
        (
            "thrust_coefficient",
            thrusts,
            THRUST_COEFFICIENTS,
            "C_T on the largest disc that fits",
            "N s^2/rad^2, not N per (rev/min)^2?",
        ),
        (
            "moment_coefficient",
            arms,
            MOMENT_ARMS,
            "torque over thrust, in radii",
            "m; torque over thrust",
        ),
    ):
        # the ranges span decades: the distance from their middle is one of logarithms
        middle = 0.5 * math.log(least * most)
        # 0 or less has no logarithm: it counts as the furthest of all
        value, rotor = max(
            zip(values, vehicle.rotors, strict=True),
            key=lambda each: abs(math.log(max(each[0], 1e-300)) - middle),
        )
        # rotors that hardly turn the vehicle still fly
        small = field == "moment_coefficient" and 0.0 < value < least
        # a file of another program flies there with this number
        theirs = f"rotors.{field}" in dict(vehicle.sources)
        level = OK if least <= value <= most else WARNING if small or theirs else FAULT
        name = f"rotors[{rotor.name}].{field}"
        text = f"{what}: {value:.3g} ({float(getattr(rotor, field)):g} in {name})"
        table = (
            f"rotors[{rotor.name}].thrust_table",
            "N, not g; N m; rad/s, not rev/min",
        )
        at, units = (name, unit) if rotor.table is None else table
        remedy = f"check {at} ({units}) and rotors.position"
        limit = least if value < least else most
        findings.append(
            Finding(
                field.replace("_", " "),
                level,
                text,
                at,
                remedy,
                value,
                limit,
                concerns=field,
            )
        )
    return findings


def thrust_number(rotor: Rotor, radius: float) -> float:
    """Thrust coefficient C_T = thrust / (rho n^2 D^4) of a rotor, n in 1/s, for a given
    disc radius.
    """
    # a coefficient by 1/s has the square of 2 pi more than one by rad/s
    turns = 4.0 * math.pi**2
    return float(rotor.thrust_coefficient) * turns / (AIR * (2.0 * radius) ** 4)


MOST_CHOICES = 12
"""Largest number of rotors, or pairs of them, among which a remedy lets choose."""


def senses_of_rotation(vehicle: Vehicle, gravity: float) -> Finding:
    """Check result for the rotors' senses of rotation: a fault if reversing one rotor
    would balance the hover.

    Of rotors that lack torque about an axis two are reversed as well, as where one side
    turns against the other. Where other rotors would balance it as well, the remedy
    names none of them alone: numbers cannot tell which of them the file states wrongly.
    """
    own = _spread(vehicle, gravity)
    question = "senses of rotation"
    limit = UNEVEN if math.isinf(own) else EVENER * own
    for count in () if own < UNEVEN else (1, 2) if math.isinf(own) else (1,):
        turns = list(combinations(vehicle.rotors, count))
        tried = [
            _spread(_with_rotors_turned(vehicle, turned), gravity) for turned in turns
        ]
        if (best := min(tried, default=math.inf)) < limit:
            # those that explain it as well are as likely
            alike = [
                turned
                for spread, turned in zip(tried, turns, strict=True)
                # 0.01 of the mean, chosen
                if spread <= best + 0.01
            ]
            # in the order of the vehicle; a rotor may be one of several pairs
            among = [each for each in vehicle.rotors if any(each in t for t in alike)]
            fields = ", ".join(f"rotors[{each.name}].direction" for each in among)
            words = "one rotor" if count == 1 else "two rotors"
            text = (
                f"hover is uneven (spread {own:.2g} of the mean) and would be even with"
                f" another sense of {words}"
            )
            if len(alike) > 1:
                choices = [
                    " and ".join(f"rotors[{each.name}].direction" for each in turned)
                    for turned in alike[:MOST_CHOICES]
                ]
                remedy = (
                    "look at the vehicle, which is wrong and to turn round:"
                    f" {', or '.join(choices)}"
                    f"{' ...' * (len(alike) > MOST_CHOICES)}"
                )
            else:
                tables = (
                    f'name = "{each.name}", direction ='
                    f' "{"cw" if each.direction > 0 else "ccw"}"'
                    for each in among
                )
                remedy = (
                    f"turn round {fields}: [[rotors]] {', [[rotors]] '.join(tables)}"
                )
            return Finding(
                question,
                FAULT,
                text,
                fields,
                remedy,
                own,
                UNEVEN,
                concerns=Concern.SENSES,
            )
    # a reversible rotor has no sense of its own
    turning = abs(
        sum(rotor.direction for rotor in vehicle.rotors if not rotor.reversible)
    )
    text = (
        f"rotors share hover evenly (spread {own:.2g} of the mean)"
        if own < UNEVEN
        else f"spread of hover {own:.2g}"
    )
    # of an odd number of rotors one more turns one way
    text += f"; {turning} more turn one way than the other" if turning > 1 else ""
    level = WARNING if turning > 1 else OK
    field = "rotors.direction"
    return Finding(
        question,
        level,
        text,
        field,
        f"check {field}",
        own,
        UNEVEN,
        concerns=Concern.SENSES,
    )


def _with_rotors_turned(vehicle: Vehicle, turned: Sequence[Rotor]) -> Vehicle:
    rotors = (
        replace(each, direction=-each.direction) if each in turned else each
        for each in vehicle.rotors
    )
    return replace(vehicle, rotors=tuple(rotors))


def _spread(vehicle: Vehicle, gravity: float) -> float:
    """Relative standard deviation of the rotors' hover thrusts, as if the centre of
    mass were not offset.
    """
    try:
        allocation = Allocation.of(vehicle)
    except AllocationError:
        # rotors that cannot hold a hover are as uneven as can be
        return math.inf
    efforts = hover_efforts(vehicle, gravity, np.zeros((1, vehicle.n)))
    # the torque that an offset mass asks for would make rotors uneven whose senses are
    # right
    efforts[:3] = 0.0
    squared = allocation.sizes(allocation.squared_speeds(efforts))[:, 0]
    thrusts = squared * [float(rotor.thrust_coefficient) for rotor in vehicle.rotors]
    return float(np.std(thrusts) / abs(np.mean(thrusts)))


ROTOR_NAME = re.compile(
    r"propell?er|rotor|(?<![a-z])props?(?![a-z])|(?<![a-z])motor_?\d", re.IGNORECASE
)
"""Pattern of names that people give to rotors."""

UPRIGHT = 0.9
"""Least vertical part of the unit axis of a joint that may spin a rotor by its
place."""


def links_like_rotors(vehicle: Vehicle) -> list[str]:
    """Names of links that end a chain, turn without limits, and have the names or
    places of rotors.

    Two or more have such names, or one beside rotors; or three or more of one mass
    stand all around the base, with upright axes.
    """
    ends = set(range(vehicle.n)) - {link.parent for link in vehicle.moving}
    free = [
        link
        for link in map(vehicle.links.__getitem__, sorted(ends))
        if -link.joint.lower == link.joint.upper == math.inf
    ]
    named = [
        link.name
        for link in free
        if ROTOR_NAME.search(f"{link.name} {link.joint.name}")
    ]
    if len(named) > (0 if vehicle.rotors else 1):
        return named
    ring = [
        k
        for k in free
        if k.parent == BASE
        and abs(float(k.joint.rotation.apply(k.joint.axis).z)) > UPRIGHT
    ]
    # rotors are equal and stand around the base: their places nearly cancel
    masses = [float(each.body.mass) for each in ring]
    places = [complex(*(each.joint.position - vehicle.base.com)[:2]) for each in ring]
    # 1 % of a mass and half of the distances are chosen
    surround = (
        len(ring) > 2
        and max(masses) < 1.01 * min(masses)
        and abs(sum(places)) < 0.5 * sum(map(abs, places))
    )
    return [each.name for each in ring] if surround else []


def rotors_as_joints(vehicle: Vehicle) -> list[Finding]:
    """Fault for driven joints that have the names or places of rotors: a law would hold
    them as an arm's.
    """
    passive = undriven_joints(vehicle)
    driven = [link.name for link in vehicle.links if link.joint.name not in passive]
    names = [name for name in links_like_rotors(vehicle) if name in driven]
    text = (
        f"joints of {', '.join(names)} turn without limits, in the names or places of"
        " rotors"
    )
    remedy = (
        f'[[rotors]] link = "{"".join(names[:1])}" makes it a rotor; a joint of an arm'
        " gets limits in [[joints]]"
    )
    return [Finding("rotors as joints", FAULT, text, "links", remedy)] if names else []
