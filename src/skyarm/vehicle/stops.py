"""Stiffness and damping of joint end stops for vehicle files that do not state them.

A real joint meets metal or rubber at its limits. How hard these are is rarely known.
The default gives way little to the joint's own drive, and asks for no shorter steps of
integration at an ordinary control period of 5 ms, unless a strong drive on a light link
would then press deep into its stop.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from skyarm.records.arrays import Array
from skyarm.vehicle.attach import Notes
from skyarm.vehicle.linkage import Joint, Link
from skyarm.vehicle.mobility import joint_mobility, of_mirrored
from skyarm.vehicle.vehicle_records import Vehicle

SOFTEST, USUAL, STIFFEST = 100.0, 200.0, 1500.0
"""Natural frequencies (rad/s) of a joint against its stop: least, usual, largest; RK4
takes steps of 5 ms up to 440."""

DEPTH = {"revolute": 0.02, "prismatic": 0.002}
"""Penetration (rad or m) of a stop by the drive's largest effort, where ``USUAL``
allows it."""

DEEPEST = 5.0
"""Largest penetration in multiples of ``DEPTH``, where ``STIFFEST`` allows it; chosen:
0.1 rad or 1 cm."""

DAMPING_RATIO = 0.5
"""Damping ratio of the joint against its stop, at that penetration; chosen: a linear
oscillator swings back by 16 % with it."""


def with_stops(vehicle: Vehicle, own: Collection[str] = ()) -> Vehicle:
    """Vehicle with end stops at all limited joints.

    The stiffness of a joint's stop holds its drive's effort at ``DEPTH``, but moves the
    joint at ``SOFTEST`` to ``USUAL``; if the effort would then press deeper than
    ``DEEPEST``, it holds it there, at up to ``STIFFEST``. A damping that the joint
    states stays.

    Args:
        vehicle: vehicle of concrete numbers.
        own: names of joints that state the stiffness of their stops, and be it none.
    """
    # joints without limits meet no stop; what a file states of one stays
    lacking = [
        any(map(math.isfinite, joint.ends))
        and joint.name not in own
        and not joint.has_stops
        for joint in vehicle.joints
    ]
    if not any(lacking):
        return vehicle
    mobilities = joint_mobility(vehicle)
    # the lightest posture has the highest frequency, which bounds the stiffness for all
    ease = of_mirrored(
        np.einsum("sii->si", mobilities).max(axis=0), mobilities
    ).tolist()
    links = tuple(
        (
            replace(k, joint=_with_stops(k.joint, e))
            # a joint that moves nothing has no frequency; the checks of the vehicle
            # refuse it
            if lacks and math.isfinite(e) and e > 0.0
            else k
        )
        for k, e, lacks in zip(vehicle.links, ease, lacking, strict=True)
    )
    return replace(vehicle, links=links)


def _stiffness(joint: Joint, ease: float) -> float:
    """Stop stiffness, N m/rad or N/m, from a joint's effort limit and its mobility,
    1/(kg m^2) or 1/kg.
    """
    # a drive of unlimited effort has no depth, so the usual frequency stands
    if not math.isfinite(joint.effort_limit):
        return USUAL**2 / ease
    shallow = float(joint.effort_limit) / DEPTH[joint.kind]
    usual = min(max(shallow, SOFTEST**2 / ease), USUAL**2 / ease)
    # a strong drive on a light link may need a stiffer stop, up to what the integrator
    # takes
    return max(usual, min(shallow / DEEPEST, STIFFEST**2 / ease))


def _with_stops(joint: Joint, ease: float) -> Joint:
    """Joint with end stops, and with matching stop damping if it has none."""
    effort = float(joint.effort_limit)
    stiffness = _stiffness(joint, ease)
    if float(joint.stop_damping) > 0.0:
        return replace(joint, stop_stiffness=stiffness)
    depth = effort / stiffness if 0.0 < effort < math.inf else DEPTH[joint.kind]
    # zeta = 1/2 of the linear oscillator at that depth, for a force k x (1 + d v)
    damping = 2.0 * DAMPING_RATIO / (math.sqrt(stiffness * ease) * depth)
    return replace(joint, stop_stiffness=stiffness, stop_damping=damping)


MOST = 3000.0
"""Largest decay rate (1/s) of friction at the six evaluated configurations; elsewhere
it may be three times as fast, and plants refuse 1e4."""

WANTED = 2500.0
"""Decay rate (1/s) to which faster friction is reduced."""

SOFTER = 1.5
"""Factor by which the speed that smooths Coulomb friction grows from one trial to the
next: the last trial bends it by no more than half too much."""


NOTE = (
    "dry friction too stiff to integrate, bent by a larger coulomb_rate; state the"
    " armature of its drive"
)


def with_smooth_friction(vehicle: Vehicle, names: Collection[str]) -> Vehicle:
    """Vehicle whose dry friction is smooth enough to be integrated.

    Args:
        vehicle: vehicle of concrete numbers.
        names: joints without a stated ``coulomb_rate``.
    """
    # nothing to bend, so the costly mobilities are not computed
    if not any(joint.name in names and joint.coulomb for joint in vehicle.joints):
        return vehicle
    links = list(vehicle.links)
    mobilities = joint_mobility(vehicle)
    viscous = _fastest([float(link.joint.damping) for link in links], mobilities)[0]
    if _fastest(_slopes(links), mobilities)[0] <= MOST:
        return vehicle
    # what viscous damping does alone is the file's own number: if that is too stiff,
    # both plants say so
    # a tenth of room above the viscous rate, which bending dry friction cannot lower
    limit = max(WANTED, 1.1 * viscous)
    while True:
        rate, shares = _fastest(_slopes(links), mobilities)
        dry = [
            _dry(link.joint) * share if link.joint.name in names else 0.0
            for link, share in zip(
                links, of_mirrored(shares, mobilities).tolist(), strict=True
            )
        ]
        # without dry friction left to bend, the rest is the file's own
        if rate <= limit or max(dry) == 0.0:
            break
        for i, own in enumerate(dry):
            if own == max(dry):  # mirrored joints together
                softer = replace(
                    links[i].joint,
                    coulomb_rate=SOFTER * float(links[i].joint.coulomb_rate),
                )
                links[i] = replace(links[i], joint=softer)
    notes = Notes()
    for old, new in zip(vehicle.links, links, strict=True):
        if new is not old:
            notes.add(NOTE, new.joint.name)
    return replace(vehicle, links=tuple(links), notes=(*vehicle.notes, *notes.lines()))


def _dry(joint: Joint) -> float:
    """Slope of the smoothed dry friction of a joint at zero rate, N m s/rad or N
    s/m.
    """
    return float(joint.coulomb) / float(joint.coulomb_rate)


def _slopes(links: Sequence[Link]) -> list[float]:
    return [float(link.joint.damping) + _dry(link.joint) for link in links]


def _fastest(slopes: Sequence[float], mobilities: Array) -> tuple[float, Array]:
    """Fastest decay rate (1/s) that friction causes at rest, and how much each joint's
    friction contributes.
    """
    root = np.sqrt(slopes)
    with np.errstate(all="ignore"):  # absurd numbers overflow; plants refuse them
        product = root[:, None] * mobilities * root
    if not np.all(np.isfinite(product)):
        return 0.0, np.zeros(len(slopes))
    rates, modes = np.linalg.eigh(product)
    # the posture with the fastest rate decides
    worst = int(np.argmax(rates[:, -1]))
    # energy of the fastest mode in each joint, per slope; 1e-300 for joints without
    # friction
    return float(rates[worst, -1]), modes[worst, :, -1] ** 2 / np.maximum(
        slopes, 1e-300
    )
