"""Rotors of Gazebo's motor models: plugins of RotorS, Gazebo classic and gz-sim in URDF
and SDF files.

The plugin pushes along z of the rotor's link, at its centre of mass, with motorConstant
w^2, and turns it with momentConstant times that thrust. Source: RotorS (Furrer et al.
2016), gazebo_motor_model.cpp; gz-sim, MulticopterMotorModel.cc; of blades gz-sim,
LiftDrag.cc, and ardupilot_gazebo, ArduPilotPlugin.cc.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from typing import Any

from skyarm.algebra import Vec3
from skyarm.records.files import must_be_one_of
from skyarm.vehicle import description
from skyarm.vehicle.check import refuse
from skyarm.vehicle.stated_rotors import RotorFile, StatedRotor
from skyarm.vehicle.xml_elements import finite, numbers, numbers_of, text_of

WORDS = {
    "motorConstant": "thrust_coefficient",
    "momentConstant": "moment_coefficient",
    "timeConstantUp": "time_constant_up",
    "timeConstantDown": "time_constant_down",
    "maxRotVelocity": "max_speed",
    "rotorDragCoefficient": "drag_coefficient",
    "rollingMomentCoefficient": "rolling_moment_coefficient",
}
"""Word of the plugin -> field of a rotor; both in SI units."""

USUAL = {"rotorDragCoefficient": 1e-4, "rollingMomentCoefficient": 1e-6}
"""Defaults with which the plugins fly where the file leaves these words out (RotorS,
gazebo_motor_model.h; gz-sim)."""

SLOWDOWN, SLOWER = "rotorVelocitySlowdownSim", "10"
"""Ratio of a rotor's speed to that of its joint in the simulation, whose link has the
more inertia; its default."""

SIGNED = "libgazebo_motor_model.so"
"""Plugin of PX4's Gazebo classic, whose rolling moment goes by the sense of rotation;
that of the others does not."""

ALONG = 0.01
"""Sine of the angle up to which a blade's lift is along its joint's axis: files round a
right angle to 1.57."""

SENSES = {"ccw": 1, "cw": -1, "1": 1, "-1": -1}


def motor_models(file: RotorFile) -> tuple[StatedRotor, ...]:
    """Rotors of the motor-model plugins of a URDF or SDF file, by their motor
    numbers.
    """
    joints = [each.get("name", "") for each in file.xml.findall("joint")]
    return tuple(
        _rotor(each, joints)
        # motor numbers, not the order in the file, are the rows of the mixer
        for each in sorted(
            filter(is_motor, file.xml.iter("plugin")), key=_number_of_motor
        )
    )


def blade_rotors(file: RotorFile) -> tuple[StatedRotor, ...]:
    """Rotors of LiftDrag plugins, as ArduPilot's: links that turn without end, with
    lift slopes in place of thrust.
    """
    links = [each.get("name", "") for each in file.xml.findall("link")]
    blades = dict[str, list[ET.Element]]()
    # lift slopes mark a blade; a wing's or a fin's link does not turn without end and
    # drops out below
    for plugin in (
        each for each in file.xml.iter("plugin") if each.find("cla") is not None
    ):
        link = text_of(plugin, "link_name")
        if link not in links:
            refuse(f"{_field(plugin)}.link_name", link, must_be_one_of(links, link))
        blades.setdefault(link, []).append(plugin)
    return tuple(
        _blade_rotor(file, joint, link, blades[link])
        for joint, link in file.endless()
        if link in blades
    )


def _blade_rotor(
    file: RotorFile, joint: ET.Element, link: str, blades: Sequence[ET.Element]
) -> StatedRotor:
    """Rotor of a link with blades: its thrust is along the joint's axis, to the side of
    their lift.
    """
    name = joint.get("name", "")
    absent = {"thrust_coefficient": "its blades are LiftDrag plugins, with lift slopes"}
    field = f"joint[{name}].axis"
    spin = description.unit_axis(
        field, numbers(joint.find("axis"), "xyz", field, (1.0, 0.0, 0.0))
    )
    # the sign of the joint's rate decides, because a blade that moves backwards lifts
    # the other way
    sides = {_side_of_lift(each, spin, _full_rate(file, name)) for each in blades}
    if sides not in ({1}, {-1}):
        absent["axis"] = (
            "<upward> of its LiftDrag plugins is not along the joint, or to both sides"
        )
    axis = -spin if sides == {-1} else spin
    return StatedRotor(
        name=link,
        link=link,
        axis=axis,
        joint=name,
        absent=absent,
        elements=tuple(blades),
    )


def _side_of_lift(blade: ET.Element, spin: Vec3, turning: float) -> int:
    """Side of the joint's axis on which a blade lifts at rest: 1, -1, or 0 for across.

    Lift is along (forward x upward) x velocity: along upward while the blade moves
    forward, as it is taken to where no plugin turns its joint; against upward while it
    moves backward.
    """
    forward, upward, arm = (
        description.vector(
            numbers_of(text_of(blade, word, usual), f"{_field(blade)}.{word}", 3)
        )
        for word, usual in (("forward", "1 0 0"), ("upward", "0 0 1"), ("cp", "0 0 0"))
    )
    upward = description.unit_axis(f"{_field(blade)}.upward", upward)
    # across or to both sides no direction of the thrust can be read
    if float(spin.cross(upward).norm()) > ALONG:
        return 0
    backward = float(spin.cross(arm).dot(forward)) * turning < 0.0
    return 1 if (float(spin.dot(upward)) > 0.0) != backward else -1


def _full_rate(file: RotorFile, joint: str) -> float:
    """Rate at which ArduPilot's plugin turns a joint at full throttle, or its sense; 0
    if there is none.
    """
    for control in file.xml.iter("control"):
        if text_of(control, "jointName") == joint:
            text = text_of(
                control, "multiplier", text_of(control, "turningDirection", "1")
            )
            # cw and ccw of newer files, a signed multiplier of older ones
            return SENSES.get(text) or finite(text, f"control[{joint}].multiplier")
    return 0.0


def is_motor(plugin: ET.Element) -> bool:
    """True for a motor-model plugin of a rotor, which states a motor constant or a
    turning direction.

    One whose motorType is position is a servo, as of the arms that tilt the rotors of
    RotorS's omav.
    """
    stated = any(
        plugin.find(mark) is not None for mark in ("motorConstant", "turningDirection")
    )
    return stated and text_of(plugin, "motorType") != "position"


def _number_of_motor(plugin: ET.Element) -> float:
    text = text_of(plugin, "motorNumber", text_of(plugin, "actuator_number", "0"))
    return finite(text, f"{_field(plugin)}.motorNumber")


def _rotor(plugin: ET.Element, joints: Sequence[str]) -> StatedRotor:
    """Rotor of one motor-model plugin, with its defaults for words left out."""
    field = _field(plugin)
    name = text_of(plugin, "linkName")
    where = {}
    absent = {}
    values = dict[str, Any]()
    assumed: tuple[str, ...] = ()
    if not name:
        refuse(f"{field}.linkName", "(missing)", "must name the rotor's link")
    for word, ours in WORDS.items():
        if text := text_of(plugin, word):
            values[ours] = finite(text, f"{field}.{word}")
            where[ours] = f"{word} of the motor-model plugins"
        elif word in USUAL:
            values[ours] = USUAL[word]
            where[ours] = f"default of {word} of the motor-model plugins"
            assumed += (f"{word} ({USUAL[word]:g})",)
    if plugin.get("filename", "").endswith(SIGNED):
        values["rolling"] = "signed"
        where["rolling"] = f"{SIGNED} of PX4"
    if sense := text_of(plugin, "turningDirection"):
        if sense not in SENSES:
            refuse(f"{field}.turningDirection", sense, "must be ccw or cw")
        values["direction"] = SENSES[sense]
        where["direction"] = "turningDirection of the motor-model plugins"
    if text_of(plugin, "reversible").lower() in ("1", "true"):
        values["reversible"] = True
        where["reversible"] = "reversible of the motor-model plugins"
    # a force- or position-controlled motor has no thrust by its speed
    if (kind := text_of(plugin, "motorType")) not in ("", "velocity"):
        values.pop("thrust_coefficient", None)
        absent["thrust_coefficient"] = (
            f"motorType is {kind}, of which thrust is not motorConstant w^2"
        )
    if (joint := text_of(plugin, "jointName")) not in ("", *joints):
        refuse(
            f"{field}.jointName",
            joint,
            f"must be a joint of the file: {', '.join(joints) or 'it has none'}",
        )
    # the simulated joint turns slower by this ratio, and its link has that much more
    # inertia
    slower = finite(text_of(plugin, SLOWDOWN, SLOWER), f"{field}.{SLOWDOWN}")
    if not slower > 0.0:
        refuse(f"{field}.{SLOWDOWN}", slower, "must be above 0")
    if joint:
        where["inertia"] = (
            f"links of the rotors, about their axes, by {SLOWDOWN} = {slower:g}"
        )
    return StatedRotor(
        name=name,
        link=name,
        values=values,
        where=where,
        joint=joint,
        slower=slower,
        assumed=assumed,
        absent=absent,
        at_mass=True,
        elements=(plugin,),
    )


def _field(plugin: ET.Element) -> str:
    return f"plugin[{plugin.get('name') or text_of(plugin, 'linkName')}]"
