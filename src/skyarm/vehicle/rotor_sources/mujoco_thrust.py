"""Rotors of MJCF files: actuators that push at a site, along the force in their gear.

The gear's torque is that on the body, the drag torque, which is against the rotor's
direction of rotation. A hinge along the thrust through the hub spins the rotor, a
driven one across the thrust tilts it. MuJoCo has no speed of a rotor: the file gives
the largest thrust. Source: MuJoCo documentation, XML reference, actuator/general (site,
gear).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from skyarm.records.arrays import Array
from skyarm.records.immutable import positional
from skyarm.vehicle import description
from skyarm.vehicle.attach import Notes
from skyarm.vehicle.mjcf_actuators import (
    LAGGING,
    at_joint,
    carriers,
    force_range,
    is_plain,
    joints_of,
    limits,
    name_of,
)
from skyarm.vehicle.stated_rotors import LAGS, MAX_THRUST, RotorFile, StatedRotor

SITE, HINGE, EQUAL_JOINTS = 4, 3, 2
"""MuJoCo's enumeration values of a transmission, of a joint, and of an equality."""

ALONG = 1e-6
"""Sine or cosine of an angle up to which two axes count as parallel or
perpendicular."""

BESIDE = 1e-3
"""Distance (m) of a hub from the axis of a hinge up to which the hinge spins it;
chosen, above the rounding of files, which state millimetres."""


@positional
class MujocoVehicle:
    """Vehicle in a MuJoCo model at rest: the body that is its base (0 for the world),
    and notes on what is not read.
    """

    model: Any
    data: Any
    root: int
    notes: Notes


def thrusts_at_sites(file: RotorFile) -> tuple[StatedRotor, ...]:
    """Rotors of an MJCF file: one for each actuator that pushes at a site in one
    direction.
    """
    if not isinstance(file.content, MujocoVehicle):
        return ()
    model = file.content.model
    sites = dict[int, list[int]]()
    for actuator in np.flatnonzero(model.actuator_trntype == SITE).tolist():
        site = model.actuator_trnid[actuator][0]
        # sites on other bodies of the world push something else than the vehicle
        if file.content.root in (0, model.body_rootid[model.site_bodyid[site]]):
            sites.setdefault(site, []).append(actuator)
    return tuple(
        rotor
        for site, actuators in sites.items()
        for rotor in _at_site(file.content, site, actuators)
    )


def _at_site(
    vehicle: MujocoVehicle, site: int, actuators: Sequence[int]
) -> list[StatedRotor]:
    """Rotors at one site; none if its actuators push or turn in several directions, as
    a whole wrench does.
    """
    model = vehicle.model
    known = [
        each
        # a dynamics that lets a constant control through leaves the thrust a number
        # times it
        for each in actuators
        if is_plain(model, each) and model.actuator_dyntype[each] in LAGGING
    ]
    pushing = [each for each in known if model.actuator_gear[each][:3].any()]
    if pushing:
        axis = model.actuator_gear[pushing[0]][:3]
        # all actuators of the site must push and turn along one line
        across = np.cross(
            axis, model.actuator_gear[actuators].reshape(-1, 3)
        ) / np.linalg.norm(axis)
        # a reference site makes the push depend on where another site is
        if abs(across).max() > ALONG or model.actuator_trnid[actuators, 1].max() >= 0:
            pushing = []
    for each in set(actuators) - set(pushing):
        why = (
            "a part of a wrench at a site, a torque of its own input, or with a bias or"
            " activation of its own"
        )
        why += ", and no rotor; not read; [[rotors]] states them"
        vehicle.notes.add(why, name_of(model, "actuator", each), "actuator")
    return [
        # one rotor at a site bears the site's name, several those of their actuators
        _rotor(vehicle, site, each, model.site(site).name if len(pushing) == 1 else "")
        for each in pushing
    ]


def _rotor(vehicle: MujocoVehicle, site: int, actuator: int, name: str) -> StatedRotor:
    """Rotor of one actuator: in base axes if the joints below it only spin or tilt it,
    else at its site.
    """
    model = vehicle.model
    data = vehicle.data
    gear = vehicle.model.actuator_gear[actuator]
    size = float(np.linalg.norm(gear[:3]))
    values = _values(model, actuator)
    thrust = data.site_xmat[site].reshape(3, 3) @ gear[:3] / size
    hub = data.site_xpos[site]
    name = name or name_of(model, "actuator", actuator)
    turned = data.xmat[vehicle.root].reshape(3, 3).T
    joints = list[int]()
    for body in carriers(model, model.site_bodyid[site]):
        if body == vehicle.root:
            break
        # outermost joint first, hence reversed within each body
        joints += reversed(joints_of(model, body))
    roles = [_role(vehicle, joint, thrust, hub) for joint in joints]
    named = dict(
        zip(roles, (name_of(model, "jnt", joint) for joint in joints), strict=True)
    )
    link = "base"
    place = turned @ (hub - data.xpos[vehicle.root])
    axis = turned @ thrust
    # any other joint below carries the rotor: it rides on an arm and is placed at its
    # site
    if roles not in ([], ["joint"], ["tilt_joint"], ["joint", "tilt_joint"]):
        link = name_of(model, "site", site)
        place = np.zeros(3)
        axis = gear[:3]
        named = {}
    least, most = force_range(model, actuator)
    # a rotor of this library stops or reverses as far as it pushes
    if least not in (0.0, -most):
        vehicle.notes.add(
            f"least thrust {size * least:.3g} N: not read; a rotor here stops, or"
            " reverses as far",
            name,
            "rotor",
        )
    if tilting := named.get("tilt_joint"):
        values["tilt"] = _tilt(vehicle, joints[-1], turned)
        far = 1e3 * float(
            np.linalg.norm(
                np.cross(data.xaxis[joints[-1]], hub - data.xanchor[joints[-1]])
            )
        )
        why = (
            f"tilts a rotor, whose hub is {far:.3g} mm beside its axis; here it stays,"
            " and what tilts is of the base"
        )
        vehicle.notes.add(why, tilting)
    return StatedRotor(
        name=name,
        link=link,
        position=description.vector(place),
        axis=description.unit_axis(f"rotors[{name}].axis", axis),
        values=values,
        where=dict.fromkeys(
            values,
            "gear, ranges and dynprm (a lag of the thrust) of the actuators at sites",
        ),
        joint=named.get("joint", ""),
        tilt_joint=named.get("tilt_joint", ""),
    )


def _values(model: Any, actuator: int) -> dict[str, Any]:
    """Numbers of a rotor that its actuator holds."""
    gear = model.actuator_gear[actuator]
    low, high = force_range(model, actuator)
    values = dict[str, Any]()
    size = float(np.linalg.norm(gear[:3]))
    lag = float(model.actuator_dynprm[actuator][0])
    # torque along the thrust per thrust; the square because both carry the gear's
    # length
    if turning := float(gear[:3] @ gear[3:]) / size**2:
        values |= {
            # torque on the body against the rotor's sense
            "moment_coefficient": abs(turning),
            "direction": -1 if turning > 0.0 else 1,
        }
    if 0.0 < high < math.inf:
        values |= {MAX_THRUST: size * high, "reversible": low == -high}
    if model.actuator_dyntype[actuator] and lag > 0.0:
        values |= dict.fromkeys(LAGS, lag)
    return values


def _role(vehicle: MujocoVehicle, joint: int, thrust: Array, hub: Array) -> str:
    """Field of a rotor that names a joint below it: a hinge that spins it, or a driven
    one that tilts it; else "".

    What tilts several rotors, or is tied to another joint, is no tilt of one: they ride
    on it.
    """
    axis = vehicle.data.xaxis[joint]
    hinge = vehicle.model.jnt_type[joint] == HINGE
    beside = np.cross(axis, hub - vehicle.data.xanchor[joint])
    if (
        hinge
        and np.linalg.norm(np.cross(axis, thrust)) <= ALONG
        and np.linalg.norm(beside) <= BESIDE
    ):
        return "joint"
    tilts = hinge and abs(axis @ thrust) <= ALONG and at_joint(vehicle.model, joint)
    return "tilt_joint" if tilts and _is_of_one(vehicle.model, joint) else ""


def _is_of_one(model: Any, joint: int) -> bool:
    """True for a joint that no equality ties to another one, and that moves one site
    with actuators.
    """
    carried = {model.jnt_bodyid[joint]}
    tied = model.eq_type == EQUAL_JOINTS
    for body in range(model.nbody):
        # children have higher numbers than their parents, so one pass finds all
        carried |= {body} if model.body_parentid[body] in carried else set()
    sites = set(model.actuator_trnid[model.actuator_trntype == SITE, 0].tolist())
    pushed = [site for site in sites if model.site_bodyid[site] in carried]
    return len(pushed) == 1 and joint not in (
        *model.eq_obj1id[tied],
        *model.eq_obj2id[tied],
    )


def _tilt(vehicle: MujocoVehicle, joint: int, turned: Array) -> dict[str, Any]:
    """Axis and range of a hinge that tilts a rotor, as fields of a tilt."""
    model = vehicle.model
    axis = description.unit_axis("tilt.axis", turned @ vehicle.data.xaxis[joint])
    if not model.jnt_limited[joint]:
        return {"axis": axis}
    lower, upper = limits(model, joint)
    return {"axis": axis, "lower": lower, "upper": upper}
